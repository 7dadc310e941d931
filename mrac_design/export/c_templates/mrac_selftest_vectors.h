/* Inputs and expected outputs of the self-test, from CasADi's own machine in double precision. */
enum { TEST_STEPS = $steps, TEST_STATES = $states };

/* Largest accepted |difference|: torques over their limit, states over 1 + |state|. */
#define TEST_TOLERANCE $tolerance

static const mrac_real test_force[MRAC_AXES] = {$resting_force};

/* q, qd, force, reference */
static const mrac_real test_inputs[TEST_STEPS][2 * MRAC_JOINTS + 2 * MRAC_AXES] = {
$inputs
};

static const double expected_torque[TEST_STEPS][MRAC_JOINTS] = {
$torque
};

static const double expected_state[TEST_STATES] = {
$final_state
};
