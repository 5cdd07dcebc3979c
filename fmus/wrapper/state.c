/* See state.h. */
#include "state.h"

#include <stdlib.h>
#include <string.h>

typedef struct State {
    PyObject *object; /* the slave's */
    PyObject *packed; /* its bytes, between asking for their number and fetching them */
    Instance *owner;
    struct State *next;
} State;

/* All states that hosts hold; the GIL guards the list. */
static State *states;

static const char NO_STATE[] = "the pointer is no FMU state of this FMU, or it has been freed";

/* Where the list points to `state`, or its end. */
static State **place_of(const void *state) {
    State **place = &states;
    while (*place != NULL && *place != state) place = &(*place)->next;
    return place;
}

static void forget(State **place) {
    State *state = *place;
    *place = state->next;
    python.Py_DecRef(state->packed);
    python.Py_DecRef(state->object);
    free(state);
}

void forget_states(Instance *own) {
    int thread = python.PyGILState_Ensure();
    for (State **place = &states; *place != NULL;) {
        if ((*place)->owner == own) {
            forget(place);
        } else {
            place = &(*place)->next;
        }
    }
    python.PyGILState_Release(thread);
}

/* Put the slave's state `object`, a reference that is taken over, into the state `old`, or a new one if it is NULL. */
static Status store(Instance *own, PyObject *object, State *old, void **slot) {
    State *state = old == NULL ? calloc(1, sizeof *state) : old;
    if (state == NULL) {
        python.Py_DecRef(object);
        tell(&own->log, ERROR, "logStatusError", "there is no memory for an FMU state");
        return ERROR;
    }
    if (old == NULL) {
        state->next = states;
        states = state;
    }
    PyObject *object_before = state->object, *packed_before = state->packed;
    state->object = object;
    state->packed = NULL;
    state->owner = own;
    *slot = state;
    python.Py_DecRef(object_before);
    python.Py_DecRef(packed_before);
    return OK;
}

static Status no_state(Instance *own) {
    tell(&own->log, ERROR, "logStatusError", NO_STATE);
    return ERROR;
}

static Status take(Instance *own, void **slot) {
    State *old = *place_of(*slot);
    if (*slot != NULL && old == NULL) return no_state(own);
    PyObject *object = NULL;
    Status status = CALL(own, &object, "get_state", "()");
    if (status > WARNING) {
        python.Py_DecRef(object);
        return status;
    }
    return store(own, object, old, slot) == OK ? status : ERROR;
}

Status get_state(Instance *own, void **slot) {
    if (!ready(own)) return ERROR;
    if (slot == NULL) return refuse(&own->log, "there is no place to put the FMU state: the pointer is NULL");
    WITH_PYTHON(status, take(own, slot));
    return status;
}

static Status put_back(Instance *own, void *pointer) {
    State *state = *place_of(pointer);
    return state == NULL ? no_state(own) : CALL(own, NULL, "set_state", "(O)", state->object);
}

Status set_state(Instance *own, void *state) {
    if (!ready(own)) return ERROR;
    if (state == NULL) return refuse(&own->log, "no FMU state was given: the pointer is NULL");
    WITH_PYTHON(status, put_back(own, state));
    return status;
}

static Status drop(Instance *own, void **slot) {
    State **place = place_of(*slot);
    if (*place == NULL) return no_state(own);
    forget(place);
    *slot = NULL;
    return OK;
}

Status free_state(Instance *own, void **slot) {
    if (!ready(own)) return ERROR;
    /* By the standard there is nothing to do then. */
    if (slot == NULL || *slot == NULL) return OK;
    WITH_PYTHON(status, drop(own, slot));
    return status;
}

/* The bytes of a state, made once for the two calls that need them, and at the second, when they are `copied`, given
 * up. */
static Status pack(Instance *own, void *pointer, void *copied, size_t *size) {
    State *state = *place_of(pointer);
    if (state == NULL) return no_state(own);
    Status status = OK;
    if (state->packed == NULL) status = CALL(own, &state->packed, "state_to_bytes", "(O)", state->object);
    char *bytes = NULL;
    Py_ssize_t found = 0;
    if (status <= WARNING && python.PyBytes_AsStringAndSize(state->packed, &bytes, &found) != 0) {
        status = tell_exception(&own->log);
    }
    if (status <= WARNING && copied != NULL && (size_t)found > *size) {
        tell(&own->log, ERROR, "logStatusError", "the array is too small for the serialized state");
        status = ERROR;
    } else if (status <= WARNING && copied != NULL) {
        memcpy(copied, bytes, (size_t)found);
    } else if (status <= WARNING) {
        *size = (size_t)found;
    }
    if (copied != NULL || status > WARNING) {
        python.Py_DecRef(state->packed);
        state->packed = NULL;
    }
    return status;
}

Status state_size(Instance *own, void *state, size_t *size) {
    if (!ready(own)) return ERROR;
    if (size == NULL)
        return refuse(&own->log, "there is no place to put the size of the FMU state: the pointer is NULL");
    WITH_PYTHON(status, pack(own, state, NULL, size));
    return status;
}

Status serialize(Instance *own, void *state, void *bytes, size_t size) {
    if (!ready(own)) return ERROR;
    if (bytes == NULL) return refuse(&own->log, "there is no place to put the serialized state: the pointer is NULL");
    WITH_PYTHON(status, pack(own, state, bytes, &size));
    return status;
}

static Status unpack(Instance *own, const void *bytes, size_t size, void **slot) {
    PyObject *object = NULL;
    PyObject *packed = python.PyBytes_FromStringAndSize(bytes, (Py_ssize_t)size);
    Status status = CALL(own, &object, "state_from_bytes", "(N)", packed);
    if (status > WARNING) {
        python.Py_DecRef(object);
        return status;
    }
    return store(own, object, *place_of(*slot), slot) == OK ? status : ERROR;
}

Status deserialize(Instance *own, const void *bytes, size_t size, void **slot) {
    if (!ready(own) || !there(own, bytes, size, 1, "bytes of the serialized state")) return ERROR;
    if (slot == NULL) return refuse(&own->log, "there is no place to put the FMU state: the pointer is NULL");
    WITH_PYTHON(status, unpack(own, bytes, size, slot));
    return status;
}
