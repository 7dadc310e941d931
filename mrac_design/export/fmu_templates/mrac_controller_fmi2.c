/* $title
 *
 * FMI 2.0 co-simulation around the sampled controller of $robot: one step every $period s.
 * Written by mrac_design $version; gains hash $gains_hash.
 *
 * Needs no header of the FMI standard and no library but the mathematics library. A value
 * reference is an index into `values`.
 */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#define PASTE(a, b) a##b
#define EXPAND(a, b) PASTE(a, b)
#ifdef FMI2_FUNCTION_PREFIX /* static linking: every function carries the model's name */
#define FMI2(name) EXPAND(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef int fmi2StatusKind;
typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String,
                                   fmi2String, ...);
typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

enum {
    INPUTS = $inputs,
    OUTPUTS = $outputs,
    VALUES = $values,
    STATES = $states,
    TORQUES = $torques
};
static const double PERIOD = $period_literal;
static const char GUID[] = "$guid";
/* Share of a period by which a communication point may miss a sampling instant. */
static const double SLACK = 1e-3;

/* Start values of inputs, outputs and parameters, in the order of the value references. */
static const double START[VALUES] = {
$start
};

typedef enum { INSTANTIATED, INITIALISING, RUNNING } phase;

/* All that changes; a copy of it is a copy of the controller. */
typedef struct {
    double values[VALUES];
    double state[STATES];
    double start_time;
    double samples; /* steps done, a whole number */
    phase phase;
} memory;

typedef struct {
    memory now;
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
    char *name;
} controller;

/* The controller at rest at the measured force. */
static void rest(const double *values, double *state)
{
$reset_statements
}

/* One sample: reads inputs and parameters, moves the state, writes the outputs. */
static void step(double *values, double *state)
{
$step_statements
}

static fmi2Status report(const controller *c, fmi2Status status, const char *text)
{
    if (c->log != NULL)
        c->log(c->environment, c->name, status,
               status == fmi2Warning ? "logStatusWarning" : "logStatusError", "%s", text);
    return status;
}

static int finite_torque(const controller *c)
{
    for (int i = 0; i < TORQUES; ++i) {
        const double torque = c->now.values[INPUTS + i];
        if (!(torque - torque == 0.0)) return 0;
    }
    return 1;
}

static void initialise(controller *c)
{
    memcpy(c->now.values, START, sizeof START);
    memset(c->now.state, 0, sizeof c->now.state);
    c->now.start_time = 0.0;
    c->now.samples = 0.0;
    c->now.phase = INSTANTIATED;
}

/* Until the first sample the outputs are what the controller at rest would give. */
static void settle(controller *c)
{
    double trial[STATES];
    rest(c->now.values, c->now.state);
    memcpy(trial, c->now.state, sizeof trial);
    step(c->now.values, trial);
}

EXPORT const char *FMI2(fmi2GetTypesPlatform)(void)
{
    return "default";
}

EXPORT const char *FMI2(fmi2GetVersion)(void)
{
    return "2.0";
}

EXPORT fmi2Status FMI2(fmi2SetDebugLogging)(fmi2Component component, fmi2Boolean on, size_t count,
                                            const fmi2String categories[])
{
    (void)component, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

EXPORT fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String guid,
                                           fmi2String resources,
                                           const fmi2CallbackFunctions *functions,
                                           fmi2Boolean visible, fmi2Boolean logging)
{
    controller *c;
    const fmi2CallbackLogger log = functions == NULL ? NULL : functions->logger;
    const fmi2ComponentEnvironment environment =
        functions == NULL ? NULL : functions->componentEnvironment;
    (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, GUID) != 0) {
        if (log != NULL)
            log(environment, name, fmi2Error, "logStatusError", "%s",
                "only co-simulation is offered, with the GUID of this very model description");
        return NULL;
    }
    c = calloc(1, sizeof *c);
    if (c == NULL) return NULL;
    c->name = calloc(strlen(name == NULL ? "" : name) + 1, 1);
    if (c->name == NULL) {
        free(c);
        return NULL;
    }
    if (name != NULL) strcpy(c->name, name);
    c->log = log;
    c->environment = environment;
    initialise(c);
    return c;
}

EXPORT void FMI2(fmi2FreeInstance)(fmi2Component component)
{
    controller *c = component;
    if (c == NULL) return;
    free(c->name);
    free(c);
}

EXPORT fmi2Status FMI2(fmi2SetupExperiment)(fmi2Component component, fmi2Boolean has_tolerance,
                                            fmi2Real tolerance, fmi2Real start,
                                            fmi2Boolean has_stop, fmi2Real stop)
{
    controller *c = component;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    c->now.start_time = start;
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2EnterInitializationMode)(fmi2Component component)
{
    controller *c = component;
    c->now.phase = INITIALISING;
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2ExitInitializationMode)(fmi2Component component)
{
    controller *c = component;
    settle(c);
    c->now.phase = RUNNING;
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2Terminate)(fmi2Component component)
{
    (void)component;
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2Reset)(fmi2Component component)
{
    initialise(component);
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2GetReal)(fmi2Component component, const fmi2ValueReference references[],
                                    size_t count, fmi2Real values[])
{
    controller *c = component;
    if (c->now.phase == INITIALISING) settle(c);
    for (size_t i = 0; i < count; ++i) {
        if (references[i] >= VALUES) return report(c, fmi2Error, "no such variable");
        values[i] = c->now.values[references[i]];
    }
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2SetReal)(fmi2Component component, const fmi2ValueReference references[],
                                    size_t count, const fmi2Real values[])
{
    controller *c = component;
    for (size_t i = 0; i < count; ++i) {
        const fmi2ValueReference reference = references[i];
        if (reference >= VALUES || (reference >= INPUTS && reference < INPUTS + OUTPUTS))
            return report(c, fmi2Error, "only inputs and parameters can be set");
        c->now.values[reference] = values[i];
    }
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2DoStep)(fmi2Component component, fmi2Real time, fmi2Real size,
                                   fmi2Boolean no_set_before)
{
    controller *c = component;
    memory *now = &c->now;
    const double end = time + size - SLACK * PERIOD;
    (void)no_set_before;
    if (!(size >= 0.0)) return report(c, fmi2Error, "a communication step cannot go back");
    /* Sampling instants in [time, time + size) fall due; inputs hold over the step. */
    while (now->start_time + now->samples * PERIOD < end) {
        step(now->values, now->state);
        now->samples += 1.0;
        if (!finite_torque(c))
            return report(c, fmi2Error, "a torque is not a finite number; inputs must be finite");
    }
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2CancelStep)(fmi2Component component)
{
    return report(component, fmi2Error, "no step is ever pending");
}

EXPORT fmi2Status FMI2(fmi2GetFMUstate)(fmi2Component component, fmi2FMUstate *state)
{
    controller *c = component;
    if (*state == NULL) *state = malloc(sizeof(memory));
    if (*state == NULL) return report(c, fmi2Error, "out of memory");
    memcpy(*state, &c->now, sizeof(memory));
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2SetFMUstate)(fmi2Component component, fmi2FMUstate state)
{
    controller *c = component;
    memcpy(&c->now, state, sizeof(memory));
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2FreeFMUstate)(fmi2Component component, fmi2FMUstate *state)
{
    (void)component;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2SerializedFMUstateSize)(fmi2Component component, fmi2FMUstate state,
                                                   size_t *size)
{
    (void)component, (void)state;
    *size = sizeof(memory);
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2SerializeFMUstate)(fmi2Component component, fmi2FMUstate state,
                                              fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(memory)) return report(component, fmi2Error, "too little room");
    memcpy(bytes, state, sizeof(memory));
    return fmi2OK;
}

EXPORT fmi2Status FMI2(fmi2DeSerializeFMUstate)(fmi2Component component, const fmi2Byte bytes[],
                                                size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(memory)) return report(component, fmi2Error, "not a state of this FMU");
    *state = malloc(sizeof(memory));
    if (*state == NULL) return report(component, fmi2Error, "out of memory");
    memcpy(*state, bytes, sizeof(memory));
    return fmi2OK;
}

/* What follows belongs to the interface, but this FMU has no such variables or abilities. */

#define NONE_OF_TYPE(name, type)                                                               \
    EXPORT fmi2Status FMI2(name)(fmi2Component component, const fmi2ValueReference references[], \
                                 size_t count, type values[])                                  \
    {                                                                                          \
        (void)references, (void)values;                                                        \
        return count == 0 ? fmi2OK : report(component, fmi2Error, "all variables are Real");   \
    }
NONE_OF_TYPE(fmi2GetInteger, fmi2Integer)
NONE_OF_TYPE(fmi2GetBoolean, fmi2Boolean)
NONE_OF_TYPE(fmi2GetString, fmi2String)
NONE_OF_TYPE(fmi2SetInteger, const fmi2Integer)
NONE_OF_TYPE(fmi2SetBoolean, const fmi2Boolean)
NONE_OF_TYPE(fmi2SetString, const fmi2String)

EXPORT fmi2Status FMI2(fmi2GetDirectionalDerivative)(
    fmi2Component component, const fmi2ValueReference unknowns[], size_t unknown_count,
    const fmi2ValueReference knowns[], size_t known_count, const fmi2Real known[],
    fmi2Real unknown[])
{
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)known;
    (void)unknown;
    return report(component, fmi2Error, "directional derivatives are not offered");
}

EXPORT fmi2Status FMI2(fmi2SetRealInputDerivatives)(fmi2Component component,
                                                    const fmi2ValueReference references[],
                                                    size_t count, const fmi2Integer orders[],
                                                    const fmi2Real values[])
{
    (void)references, (void)count, (void)orders, (void)values;
    return report(component, fmi2Error, "inputs are held, not extrapolated");
}

EXPORT fmi2Status FMI2(fmi2GetRealOutputDerivatives)(fmi2Component component,
                                                     const fmi2ValueReference references[],
                                                     size_t count, const fmi2Integer orders[],
                                                     fmi2Real values[])
{
    (void)references, (void)count, (void)orders, (void)values;
    return report(component, fmi2Error, "outputs are held: their derivatives are zero");
}

#define NO_STATUS(name, type)                                                                  \
    EXPORT fmi2Status FMI2(name)(fmi2Component component, fmi2StatusKind kind, type *value)    \
    {                                                                                          \
        (void)kind, (void)value;                                                               \
        return report(component, fmi2Discard, "steps are never pending");                      \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetRealStatus, fmi2Real)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetBooleanStatus, fmi2Boolean)
NO_STATUS(fmi2GetStringStatus, fmi2String)
