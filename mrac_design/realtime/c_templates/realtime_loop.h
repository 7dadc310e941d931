/* The exported controller in real time against a simulated robot. */
#ifndef REALTIME_LOOP_H
#define REALTIME_LOOP_H

#include "mrac_controller.h"
#include "realtime_sizes.h"

/* The simulated robot: carries n intervals out; see the generated program it comes from. */
long run(long n, const double *start, const double *length, const long long *substeps,
         const long long *segment, const double *offset, const unsigned char *records,
         const unsigned char *updates, const double *coefficients, const double *parameters,
         double *state, double *held, double *recorded);

/* Everything the loop reads and writes; all of it exists before the loop begins. */
typedef struct {
    long periods;
    double period; /* s */
    const long long *first; /* the first interval of each period, and one past the last */
    const double *start, *length, *offset;
    const long long *substeps, *segment;
    const unsigned char *nothing; /* a zero an interval: neither a record nor an update */
    const double *coefficients, *parameters;
    double *state, *held;
    mrac_inputs inputs;
    mrac_parameters controller_parameters;
    mrac_state controller;
    long long *wake;  /* ns from the beginning of the period to the wake-up */
    long long *step;  /* ns of mrac_step */
    long long *cycle; /* ns from the beginning of the period to the end of its work */
    double *torque;   /* as computed, joint by joint */
} realtime_experiment;

/* Runs the work of a period a few times on copies, so that code, data and stack are in memory.
   Returns what a reading of the clock costs, in ns. */
long long realtime_warm_up(const realtime_experiment *experiment);

/* Runs all periods; returns how many ended with finite torques. */
long realtime_loop(realtime_experiment *experiment);

#endif
