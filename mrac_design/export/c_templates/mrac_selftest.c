/* Self-test of the controller: exit status 0 when it computes what it should.
 *
 * The expected values were computed by CasADi's own machine in double precision when the package
 * was made, neither by this code nor by a compiler.
$tolerance_comment
 *
 * With a number as argument, the sequence is repeated that often and timed.
 */
#include "mrac_controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "mrac_selftest_vectors.h"

static double worst(double deviation, double value, double expected, double scale)
{
    const double own = fabs(value - expected) / scale;
    return own <= deviation ? deviation : own; /* NaN wins */
}

static mrac_outputs step(mrac_state *state, const mrac_parameters *parameters, int k)
{
    mrac_inputs inputs;
    mrac_outputs outputs;
    const mrac_real *row = test_inputs[k];
    for (int i = 0; i < MRAC_JOINTS; ++i) {
        inputs.q[i] = row[i];
        inputs.qd[i] = row[MRAC_JOINTS + i];
    }
    for (int i = 0; i < MRAC_AXES; ++i) {
        inputs.force[i] = row[2 * MRAC_JOINTS + i];
        inputs.reference[i] = row[2 * MRAC_JOINTS + MRAC_AXES + i];
    }
    (void)mrac_step(state, parameters, &inputs, &outputs);
    return outputs;
}

static double check(void)
{
    mrac_parameters parameters;
    mrac_state state;
    double deviation = 0.0;
    mrac_init(&state, &parameters);
    mrac_reset(&state, &parameters, test_force);
    for (int k = 0; k < TEST_STEPS; ++k) {
        const mrac_outputs outputs = step(&state, &parameters, k);
        for (int i = 0; i < MRAC_JOINTS; ++i)
            deviation = worst(deviation, (double)outputs.torque[i], expected_torque[k][i],
                              (double)parameters.effort_limit[i]);
    }
    {
        const mrac_real final[TEST_STATES] = {
$final_state_list
        };
        for (int i = 0; i < TEST_STATES; ++i)
            deviation = worst(deviation, (double)final[i], expected_state[i],
                              1.0 + fabs(expected_state[i]));
    }
    return deviation;
}

static void measure(long repetitions)
{
    mrac_parameters parameters;
    mrac_state state;
    double sum = 0.0;
    clock_t start;
    mrac_init(&state, &parameters);
    start = clock();
    for (long r = 0; r < repetitions; ++r) {
        mrac_reset(&state, &parameters, test_force);
        for (int k = 0; k < TEST_STEPS; ++k) sum += (double)step(&state, &parameters, k).torque[0];
    }
    printf("%.4f microseconds a step (checksum %g)\n",
           1e6 * (double)(clock() - start) / (double)CLOCKS_PER_SEC
               / ((double)repetitions * (double)TEST_STEPS), sum);
}

int main(int argc, char **argv)
{
    const double deviation = check();
    printf("%s\n%d steps, largest deviation %.3g, accepted %.3g\n", mrac_identity(), TEST_STEPS,
           deviation, TEST_TOLERANCE);
    if (!(deviation <= TEST_TOLERANCE)) {
        printf("FAILED: see README.md, section \"Compiling\"\n");
        return EXIT_FAILURE;
    }
    if (argc > 1) measure(strtol(argv[1], NULL, 10));
    return EXIT_SUCCESS;
}
