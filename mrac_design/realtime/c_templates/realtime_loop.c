/* The loop itself: nothing is allocated here, and nothing is read or written but memory. */
#define _GNU_SOURCE
#include "realtime_loop.h"

#include <errno.h>
#include <string.h>
#include <time.h>
#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

enum { WARM_UPS = 20, CLOCK_READINGS = 100 };

static long long now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (long long)t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void sleep_until(long long instant)
{
    const struct timespec t = { instant / 1000000000LL, instant % 1000000000LL };
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) {}
}

/* Denormal numbers count as zero, as in the simulation: they make filters slow and mean nothing.
   Elsewhere than on x86 and 64-bit Arm they stay what they are. */
static void flush_denormals(void)
{
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | 0x8040u);
#elif defined(__aarch64__)
    unsigned long mode;
    __asm__ volatile("mrs %0, fpcr" : "=r"(mode));
    __asm__ volatile("msr fpcr, %0" : : "r"(mode | 1ul << 24));
#endif
}

/* Reads the robot's sensors at the beginning of period k. */
static void sense(realtime_experiment *e, long k)
{
    static const unsigned char no = 0, yes = 1;
    static const long long no_steps = 0;
    const long long i = e->first[k];
    const double *told = e->held + TOLD_AT;
    (void)run(1, e->start + i, e->length + i, &no_steps, e->segment + i, e->offset + i, &no, &yes,
              e->coefficients, e->parameters, e->state, e->held, NULL);
    for (int j = 0; j < MRAC_JOINTS; ++j) e->inputs.q[j] = (mrac_real)*told++;
    for (int j = 0; j < MRAC_JOINTS; ++j) e->inputs.qd[j] = (mrac_real)*told++;
    for (int j = 0; j < MRAC_AXES; ++j) e->inputs.force[j] = (mrac_real)*told++;
    for (int j = 0; j < MRAC_AXES; ++j) e->inputs.reference[j] = (mrac_real)*told++;
}

/* Hands torques to the robot and moves it to the end of period k. */
static void act(realtime_experiment *e, long k, const double *torque)
{
    const long long i = e->first[k];
    double *pipeline = e->held + PIPELINE_AT;
    memmove(pipeline + MRAC_JOINTS, pipeline, (PIPELINE_SIZE - MRAC_JOINTS) * sizeof *pipeline);
    memcpy(pipeline, torque, MRAC_JOINTS * sizeof *pipeline);
    (void)run((long)(e->first[k + 1] - i), e->start + i, e->length + i, e->substeps + i,
              e->segment + i, e->offset + i, e->nothing, e->nothing, e->coefficients,
              e->parameters, e->state, e->held, NULL);
}

static void copy_torque(const mrac_outputs *outputs, double *torque)
{
    for (int j = 0; j < MRAC_JOINTS; ++j) torque[j] = (double)outputs->torque[j];
}

long long realtime_warm_up(const realtime_experiment *experiment)
{
    double state[STATES], held[HELD], torque[MRAC_JOINTS];
    mrac_outputs outputs;
    long long cheapest = 1000000000LL;
    for (int i = 0; i < WARM_UPS; ++i) {
        realtime_experiment copy = *experiment;
        memcpy(state, experiment->state, sizeof state);
        memcpy(held, experiment->held, sizeof held);
        copy.state = state;
        copy.held = held;
        sense(&copy, 0);
        (void)mrac_step(&copy.controller, &copy.controller_parameters, &copy.inputs, &outputs);
        copy_torque(&outputs, torque);
        act(&copy, 0, torque);
        sleep_until(now());
    }
    for (int i = 0; i < CLOCK_READINGS; ++i) {
        const long long before = now(), cost = now() - before;
        if (cost < cheapest) cheapest = cost;
    }
    return cheapest;
}

long realtime_loop(realtime_experiment *e)
{
    const double nanoseconds = 1e9 * e->period;
    mrac_outputs outputs;
    flush_denormals();
    sense(e, 0);
    const long long origin = now() + 1000000LL;
    for (long k = 0; k < e->periods; ++k) {
        const long long begin = origin + (long long)((double)k * nanoseconds + 0.5);
        sleep_until(begin);
        const long long woken = now();
        const int finite =
            mrac_step(&e->controller, &e->controller_parameters, &e->inputs, &outputs);
        const long long done = now();
        double *torque = e->torque + (size_t)k * MRAC_JOINTS;
        copy_torque(&outputs, torque);
        if (!finite) return k;
        act(e, k, torque);
        if (k + 1 < e->periods) sense(e, k + 1);
        e->wake[k] = woken - begin;
        e->step[k] = done - woken;
        e->cycle[k] = now() - begin;
    }
    return e->periods;
}
