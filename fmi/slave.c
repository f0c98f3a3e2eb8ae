/* Co-simulation interface of FMI 2.0 around a model with real variables.
 *
 * The value reference of a variable is its slot in an array of doubles: inputs first, then parameters,
 * then outputs. model.h defines
 *   MODEL_GUID, MODEL_STEP_S (time step [s]), numbers of slots: MODEL_INPUTS, MODEL_SETTABLE (inputs and
 *   parameters), MODEL_SLOTS (all), model_start and model_names (start value and name of each slot),
 *   model_memory (a type without pointers), model_begin(memory, slots) and
 *   model_advance(memory, slots, steps), which fill the outputs.
 * The last two return 0, or 1 + the slot of a value that is out of bounds, or -1 for any other failure.
 */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } status;
typedef void (*logger)(void *environment, const char *instance, status, const char *category,
                       const char *text, ...);
typedef struct {
    logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, status);
    void *environment;
} callbacks;

typedef enum { INSTANTIATED, INITIALISING, RUNNING, TERMINATED } phase;

/* Everything that a stored state of the FMU contains. */
typedef struct {
    phase phase;
    double start_s;   /* time at which the simulation starts */
    double steps;     /* time steps since the start */
    double slots[MODEL_SLOTS];
    model_memory memory;
} core;

typedef struct {
    core core;
    const callbacks *functions;
    char *name;
} instance;

static status fail(instance *me, const char *format, ...)
{
    char text[512];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    if (me->functions && me->functions->log)
        me->functions->log(me->functions->environment, me->name, ERROR, "logStatusError", "%s", text);
    return ERROR;
}

static void forget(core *it)
{
    memset(it, 0, sizeof *it);
    memcpy(it->slots, model_start, sizeof it->slots);
}

static double now(const core *it)
{
    return it->start_s + it->steps * MODEL_STEP_S;
}

static status judge(instance *me, int code)
{
    if (code > 0)
        return fail(me, "the simulation diverges at %g s: %s = %g. An input or a parameter is many "
                    "orders too large, or too fast for the time step of %g s", now(&me->core),
                    model_names[code - 1], me->core.slots[code - 1], MODEL_STEP_S);
    return code ? fail(me, "the model failed at %g s", now(&me->core)) : OK;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT status fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return OK;
}

EXPORT void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                             const callbacks *functions, int visible, int logging)
{
    (void)resources, (void)visible, (void)logging;
    instance *me = calloc(1, sizeof *me);
    if (!me)
        return NULL;
    me->functions = functions;
    me->name = calloc(1, name ? strlen(name) + 1 : 1);
    if (me->name && name)
        strcpy(me->name, name);
    forget(&me->core);
    if (!me->name || kind != 1 || !guid || strcmp(guid, MODEL_GUID)) {
        fail(me, "not instantiated: only co-simulation is supported, with the GUID %s", MODEL_GUID);
        free(me->name);
        free(me);
        return NULL;
    }
    return me;
}

EXPORT void fmi2FreeInstance(void *c)
{
    if (c)
        free(((instance *)c)->name);
    free(c);
}

EXPORT status fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start,
                                  int has_stop, double stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((instance *)c)->core.start_s = start;
    return OK;
}

EXPORT status fmi2EnterInitializationMode(void *c)
{
    instance *me = c;
    if (me->core.phase != INSTANTIATED)
        return fail(me, "the initialization mode can be entered only once, after the instantiation");
    me->core.phase = INITIALISING;
    return judge(me, model_begin(&me->core.memory, me->core.slots));
}

EXPORT status fmi2ExitInitializationMode(void *c)
{
    instance *me = c;
    if (me->core.phase != INITIALISING)
        return fail(me, "the initialization mode was not entered");
    me->core.phase = RUNNING;
    return judge(me, model_begin(&me->core.memory, me->core.slots));
}

EXPORT status fmi2Terminate(void *c)
{
    ((instance *)c)->core.phase = TERMINATED;
    return OK;
}

EXPORT status fmi2Reset(void *c)
{
    forget(&((instance *)c)->core);
    return OK;
}

EXPORT status fmi2GetReal(void *c, const unsigned reference[], size_t n, double value[])
{
    instance *me = c;
    int outputs = 0;
    for (size_t i = 0; i < n; i++) {
        if (reference[i] >= MODEL_SLOTS)
            return fail(me, "no real variable has the value reference %u", reference[i]);
        outputs |= reference[i] >= MODEL_SETTABLE;
    }
    if (outputs && me->core.phase == INITIALISING) { /* Inputs may have been set in this mode. */
        status found = judge(me, model_begin(&me->core.memory, me->core.slots));
        if (found != OK)
            return found;
    }
    for (size_t i = 0; i < n; i++)
        value[i] = me->core.slots[reference[i]];
    return OK;
}

EXPORT status fmi2SetReal(void *c, const unsigned reference[], size_t n, const double value[])
{
    instance *me = c;
    for (size_t i = 0; i < n; i++) {
        if (reference[i] >= MODEL_SETTABLE)
            return fail(me, "value reference %u is no input and no parameter", reference[i]);
        if (reference[i] >= MODEL_INPUTS && me->core.phase >= RUNNING)
            return fail(me, "%s is a fixed parameter: set it before the end of the initialization",
                        model_names[reference[i]]);
        if (!isfinite(value[i]))
            return fail(me, "%s = %g: must be a finite number", model_names[reference[i]], value[i]);
        me->core.slots[reference[i]] = value[i];
    }
    return OK;
}

EXPORT status fmi2DoStep(void *c, double time, double length, int no_return)
{
    instance *me = c;
    (void)no_return;
    double steps = floor(length / MODEL_STEP_S + 0.5);
    if (me->core.phase != RUNNING)
        return fail(me, "a step is possible only between initialization and termination");
    if (fabs(time - now(&me->core)) > 1e-3 * MODEL_STEP_S)
        return fail(me, "a step from %.10g s was asked for, but the FMU is at %.10g s: restore an "
                    "earlier state by fmi2SetFMUstate to repeat a step", time, now(&me->core));
    if (!(steps >= 1.0 && steps <= 1e9) || fabs(length - steps * MODEL_STEP_S) > 1e-6 * MODEL_STEP_S)
        return fail(me, "communication step %.10g s: must be a whole multiple of the time step of this "
                    "FMU, %.10g s, such as %.10g s; or export an FMU with another time step", length,
                    MODEL_STEP_S, MODEL_STEP_S * (steps >= 1.0 && steps <= 1e9 ? steps : 1.0));
    int code = model_advance(&me->core.memory, me->core.slots, (long)steps);
    me->core.steps += steps;
    return judge(me, code);
}

EXPORT status fmi2GetFMUstate(void *c, void **state)
{
    if (!*state && !(*state = malloc(sizeof(core))))
        return fail(c, "not enough memory to store the state");
    memcpy(*state, &((instance *)c)->core, sizeof(core));
    return OK;
}

EXPORT status fmi2SetFMUstate(void *c, void *state)
{
    memcpy(&((instance *)c)->core, state, sizeof(core));
    return OK;
}

EXPORT status fmi2FreeFMUstate(void *c, void **state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(core);
    return OK;
}

EXPORT status fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size)
{
    if (size < sizeof(core))
        return fail(c, "a state has %u bytes", (unsigned)sizeof(core));
    memcpy(bytes, state, sizeof(core));
    return OK;
}

EXPORT status fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state)
{
    if (size != sizeof(core))
        return fail(c, "a state has %u bytes", (unsigned)sizeof(core));
    if (!*state && !(*state = malloc(sizeof(core))))
        return fail(c, "not enough memory to store the state");
    memcpy(*state, bytes, sizeof(core));
    return OK;
}

EXPORT status fmi2CancelStep(void *c) { return fail(c, "no step is running"); }

/* Variables of other types, derivatives and steps in the background do not exist in these models. */
#define ABSENT(function, ...) \
    EXPORT status function(void *c, __VA_ARGS__) { return fail(c, "%s is not supported", #function); }
#define ABSENT_IF_ANY(function, ...)                                                             \
    EXPORT status function(void *c, const unsigned r[], size_t n, __VA_ARGS__)                   \
    {                                                                                            \
        return n ? fail(c, "no variable has the value reference %u in %s", r[0], #function) : OK; \
    }
ABSENT_IF_ANY(fmi2GetInteger, int value[])
ABSENT_IF_ANY(fmi2GetBoolean, int value[])
ABSENT_IF_ANY(fmi2GetString, const char *value[])
ABSENT_IF_ANY(fmi2SetInteger, const int value[])
ABSENT_IF_ANY(fmi2SetBoolean, const int value[])
ABSENT_IF_ANY(fmi2SetString, const char *const value[])
ABSENT_IF_ANY(fmi2SetRealInputDerivatives, const int order[], const double value[])
ABSENT_IF_ANY(fmi2GetRealOutputDerivatives, const int order[], double value[])
ABSENT(fmi2GetDirectionalDerivative, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
       const double du[], double dy[])
ABSENT(fmi2GetStatus, int kind, status *value)
ABSENT(fmi2GetRealStatus, int kind, double *value)
ABSENT(fmi2GetIntegerStatus, int kind, int *value)
ABSENT(fmi2GetBooleanStatus, int kind, int *value)
ABSENT(fmi2GetStringStatus, int kind, const char **value)
