/* realtime INPUTS RECORD: reads the experiment, asks the system for what real time needs, runs the
 * loop and writes what it measured. Facts go to standard output as JSON. */
#define _GNU_SOURCE
#include "realtime_loop.h"

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>

enum { PAGE = 4096 };

static void fail(const char *what)
{
    fprintf(stderr, "%s%s%s\n", what, errno ? ": " : "", errno ? strerror(errno) : "");
    exit(EXIT_FAILURE);
}

static void *reserve(size_t count, size_t size)
{
    void *memory = calloc(count + 1, size);
    if (memory == NULL) fail("the record does not fit in memory");
    /* Touching it brings every page in before the loop begins; compilers may drop a memset. */
    for (size_t i = 0; i < (count + 1) * size; i += PAGE) ((volatile char *)memory)[i] = 0;
    return memory;
}

static void *load(FILE *file, size_t count, size_t size)
{
    void *memory = reserve(count, size);
    if (fread(memory, size, count, file) != count) fail("the experiment is cut off");
    return memory;
}

static void load_experiment(const char *path, realtime_experiment *e)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) fail(path);
    const long long *counts = load(file, 3, sizeof *counts);
    const size_t periods = (size_t)counts[0], intervals = (size_t)counts[1];
    const double *period = load(file, 1, sizeof *period);
    e->periods = (long)periods;
    e->period = *period;
    e->first = load(file, periods + 1, sizeof *e->first);
    e->start = load(file, intervals, sizeof *e->start);
    e->length = load(file, intervals, sizeof *e->length);
    e->substeps = load(file, intervals, sizeof *e->substeps);
    e->segment = load(file, intervals, sizeof *e->segment);
    e->offset = load(file, intervals, sizeof *e->offset);
    e->coefficients = load(file, (size_t)counts[2], sizeof *e->coefficients);
    e->parameters = load(file, PARAMETERS, sizeof *e->parameters);
    e->state = load(file, STATES, sizeof *e->state);
    e->held = load(file, HELD, sizeof *e->held);
    const double *resting = load(file, MRAC_AXES, sizeof *resting);
    fclose(file);
    mrac_real force[MRAC_AXES];
    for (int i = 0; i < MRAC_AXES; ++i) force[i] = (mrac_real)resting[i];
    mrac_init(&e->controller, &e->controller_parameters);
    mrac_reset(&e->controller, &e->controller_parameters, force);
    e->nothing = reserve(intervals, sizeof *e->nothing);
    e->wake = reserve(periods, sizeof *e->wake);
    e->step = reserve(periods, sizeof *e->step);
    e->cycle = reserve(periods, sizeof *e->cycle);
    e->torque = reserve(periods * MRAC_JOINTS, sizeof *e->torque);
}

static void save_record(const char *path, const realtime_experiment *e)
{
    const size_t periods = (size_t)e->periods, torques = periods * MRAC_JOINTS;
    FILE *file = fopen(path, "wb");
    if (file == NULL) fail(path);
    const size_t written = fwrite(e->wake, sizeof *e->wake, periods, file)
                           + fwrite(e->step, sizeof *e->step, periods, file)
                           + fwrite(e->cycle, sizeof *e->cycle, periods, file)
                           + fwrite(e->torque, sizeof *e->torque, torques, file);
    if (fclose(file) != 0 || written != 3 * periods + torques) fail(path);
}

/* Empty when granted, else why not. */
static const char *outcome(int status) { return status == 0 ? "" : strerror(errno); }

static const char *real_time_priority(void)
{
    struct sched_param wanted;
    memset(&wanted, 0, sizeof wanted);
    wanted.sched_priority = sched_get_priority_max(SCHED_FIFO) - 19;
    return outcome(sched_setscheduler(0, SCHED_FIFO, &wanted));
}

int main(int argc, char **argv)
{
    static realtime_experiment experiment;
    struct rusage before, after;
    char lock[128], priority[128];
    if (argc != 3) {
        fprintf(stderr, "usage: realtime INPUTS RECORD\n");
        return EXIT_FAILURE;
    }
    load_experiment(argv[1], &experiment);
    (void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); /* else wake-ups may be 50 us late */
    snprintf(priority, sizeof priority, "%s", real_time_priority());
    const long long clock_cost = realtime_warm_up(&experiment);
    snprintf(lock, sizeof lock, "%s", outcome(mlockall(MCL_CURRENT | MCL_FUTURE)));
    getrusage(RUSAGE_SELF, &before);
    const long finished = realtime_loop(&experiment);
    getrusage(RUSAGE_SELF, &after);
    (void)munlockall(); /* writing the record may need memory again */
    if (finished < experiment.periods) {
        fprintf(stderr, "the torques of period %ld are not finite numbers\n", finished);
        return EXIT_FAILURE;
    }
    save_record(argv[2], &experiment);
    printf("{\"identity\": \"%s\", \"memory_lock\": \"%s\", \"priority\": \"%s\", "
           "\"clock_cost_ns\": %lld, \"page_faults\": %ld, \"preemptions\": %ld}\n",
           mrac_identity(), lock, priority, clock_cost,
           after.ru_minflt + after.ru_majflt - before.ru_minflt - before.ru_majflt,
           after.ru_nivcsw - before.ru_nivcsw);
    return EXIT_SUCCESS;
}
