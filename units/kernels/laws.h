/* The passive laws by number: each a file in laws/ and a line in each of the two lists. */

#ifndef LAW_LIST
#define LAW_LIST
#define LAW_PARAMETERS 8
static const char *const LAW_NAMES[] = {"neo_hooke", "holzapfel_fiber", "guccione"};

/* The number by which solid->law knows the law `name`; -1 for one that was not compiled. */
EXPORT int law_number(const char *name)
{
    for (int number = 0; number < (int)(sizeof LAW_NAMES / sizeof *LAW_NAMES); number++)
        if (!strcmp(LAW_NAMES[number], name))
            return number;
    return -1;
}
#endif

#include "laws/neo_hooke.h"
#include "laws/holzapfel_fiber.h"
#include "laws/guccione.h"

typedef void VARIANT(law_function)(const double *parameters, const struct strain *at, int with_energy, int with_tangent,
                                   struct response *response);

static VARIANT(law_function) *const VARIANT(LAWS)[] = {VARIANT(neo_hooke), VARIANT(holzapfel_fiber), VARIANT(guccione)};

static inline void VARIANT(law)(int number, const double *parameters, const struct strain *at, int with_energy,
                                int with_tangent, struct response *response)
{
    VARIANT(LAWS)[number](parameters, at, with_energy, with_tangent, response);
}
