/* A ship: the machine code of the package's equations with the record of one ship.
 *
 * model.h defines ship_record, ship_state and ship_sea (constants), SHIP_STATE, SHIP_MEMORY and SHIP_SEA
 * (sizes in doubles), SHIP_SAMPLE (first slot of the outputs) and SHIP_BEGIN (prepares the simulation).
 */
#include <stdint.h>

typedef struct {
    double state[SHIP_STATE], memory[SHIP_MEMORY], sea[SHIP_SEA];
} model_memory;

extern int64_t shaftline_run(const void *record, void *state, void *memory, void *sea, double *slots,
                             double *sample, int64_t steps);

/* Functions of Numba that the machine code refers to. Arrays: short scratch arrays of some terms, with
 * the header that Numba's compiler expects. Exceptions: only if there is no memory for these. */
typedef struct {
    size_t references;
    void *destructor, *about, *data;
    size_t size;
    void *allocator;
} array_header;

void *NRT_MemInfo_alloc_aligned(size_t size, unsigned align)
{
    array_header *header = malloc(sizeof *header + size + align);
    if (!header)
        return NULL;
    uintptr_t data = (uintptr_t)(header + 1);
    data += (align - data % align) % align;
    *header = (array_header){1, NULL, NULL, (void *)data, size, NULL};
    return header;
}

static int raised; /* whether an exception occurred; Numba's compiler reports it to Python alone */
char PyExc_StopIteration, PyExc_RuntimeError, PyExc_SystemError;
void NRT_MemInfo_call_dtor(void *header) { free(header); }
void NRT_Free(void *memory) { free(memory); }
void numba_gil_ensure(void *a) { (void)a, raised = 1; }
void numba_gil_release(void *a) { (void)a; }
void numba_do_raise(void *a) { (void)a; }
void *numba_unpickle(void *a, int b, void *c) { return (void)a, (void)b, (void)c, NULL; }
void *numba_runtime_build_excinfo_struct(void *a, void *b) { return (void)a, (void)b, NULL; }
void *PyBytes_FromStringAndSize(void *a, int64_t b) { return (void)a, (void)b, NULL; }
void *PyUnicode_FromString(void *a) { return (void)a, NULL; }
void PyErr_SetString(void *a, void *b) { (void)a, (void)b; }
void PyErr_SetNone(void *a) { (void)a; }
void PyErr_WriteUnraisable(void *a) { (void)a; }
void PyErr_Clear(void) {}
void Py_DecRef(void *a) { (void)a; }

static int run(model_memory *m, double *slots, int64_t steps)
{
    raised = 0;
    double *sample = slots + SHIP_SAMPLE;
    int64_t code = shaftline_run(ship_record, m->state, m->memory, m->sea, slots, sample, steps);
    return raised ? -1 : (int)code;
}

static int model_begin(model_memory *m, double *slots)
{
    memset(m, 0, sizeof *m);
    memcpy(m->state, ship_state, sizeof m->state);
    memcpy(m->sea, ship_sea, sizeof m->sea);
    return run(m, slots, SHIP_BEGIN);
}

static int model_advance(model_memory *m, double *slots, long steps)
{
    return run(m, slots, steps);
}
