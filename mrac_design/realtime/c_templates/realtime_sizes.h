/* Where things lie in the vectors of the simulated robot. Generated. */
#ifndef REALTIME_SIZES_H
#define REALTIME_SIZES_H

enum {
    STATES = $states, HELD = $held, PARAMETERS = $parameters,
    /* In the held memory: torques on their way, newest first, and what the controller is told. */
    PIPELINE_AT = $pipeline_at, PIPELINE_SIZE = $pipeline_size, TOLD_AT = $told_at
};

#endif
