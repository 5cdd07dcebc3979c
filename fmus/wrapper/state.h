/* The FMU states that the host holds. Each belongs to the instance that made it last, and ends with it at the latest.
 */
#ifndef COSIM_WRAPPER_STATE_H
#define COSIM_WRAPPER_STATE_H

#include "instance.h"

/* {fmi2,fmi3}GetFMU{s,S}tate and so on. A pointer that is no state of this library is refused; where a state is to be
 * stored, one that is there is overwritten. */
Status get_state(Instance *own, void **slot);
Status set_state(Instance *own, void *state);
Status free_state(Instance *own, void **slot);
Status state_size(Instance *own, void *state, size_t *size);
Status serialize(Instance *own, void *state, void *bytes, size_t size);
Status deserialize(Instance *own, const void *bytes, size_t size, void **slot);

/* Free what `own` has, before it is freed itself. */
void forget_states(Instance *own);

#endif
