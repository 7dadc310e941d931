/* $title
 *
 * Adaptive force control of $robot, $axes, with linearising torque; one step every $period s.
$provenance
 *
 * Written by mrac_design $version. Gains hash $gains_hash.
 * Call mrac_init once, then mrac_step at every sample. Nothing is allocated, nothing is global
 * but constants; two controllers are two pairs of structs. SI units; joint efforts are N m or N.
 */
#ifndef MRAC_CONTROLLER_H
#define MRAC_CONTROLLER_H

#ifdef __cplusplus
extern "C" {
#endif

#define MRAC_VERSION "$version"
#define MRAC_GAINS_HASH "$gains_hash"
#define MRAC_PARAMETERS_HASH "$parameters_hash"

enum { MRAC_JOINTS = $joints, MRAC_AXES = $axis_count };

typedef $real mrac_real;

/* Sampling period (s) the controller was made for. */
#define MRAC_PERIOD ((mrac_real)$period_literal)

/* Everything tunable. mrac_init fills in the design. */
typedef struct {
$parameter_members
} mrac_parameters;

/* Everything remembered from step to step. */
typedef struct {
$state_members
} mrac_state;

/* What a step is given. All entries must be finite. */
typedef struct {
    mrac_real q[MRAC_JOINTS];        /* joint positions, rad or m */
    mrac_real qd[MRAC_JOINTS];       /* joint velocities, rad/s or m/s */
    mrac_real force[MRAC_AXES];      /* measured contact force on $axes, N */
    mrac_real reference[MRAC_AXES];  /* force reference before the pre-filter, N */
} mrac_inputs;

/* What a step gives. */
typedef struct {
    mrac_real torque[MRAC_JOINTS]; /* joint efforts within their limits, N m or N */
$signal_members
} mrac_outputs;

/* Parameters as designed, and the state at rest at zero force. */
void mrac_init(mrac_state *state, mrac_parameters *parameters);

/* The state at rest at the given force and reference (N), gains back at their start. */
void mrac_reset(mrac_state *state, const mrac_parameters *parameters,
                const mrac_real force[MRAC_AXES]);

/* One sample. Limited torques are fed back into the adaptation.
 * Returns 1 if every torque is a finite number, else 0: then do not use them, and reset. */
int mrac_step(mrac_state *state, const mrac_parameters *parameters, const mrac_inputs *inputs,
              mrac_outputs *outputs);

/* Version and hashes as one string, so that a binary can be told from another. */
const char *mrac_identity(void);

#ifdef __cplusplus
}
#endif

#endif
