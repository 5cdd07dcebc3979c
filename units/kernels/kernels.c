/* All kernels, compiled once for each instruction set: the same text, included with another name behind every function.
   Whoever calls takes the best that the processor has (kernel_variant), and all numbers then come from one of them: two
   instruction sets round differently.

   Nothing here allocates, keeps anything between two calls, or calls Python. Sizes are checked by the callers. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define JOIN_NAMES(name, variant) name##_##variant
#define JOIN(name, variant) JOIN_NAMES(name, variant)
/* The name of a function in the variant that is being compiled; EXPORT makes it one that Python sees. */
#define VARIANT(name) JOIN(name, INSTRUCTIONS)
#define EXPORT __attribute__((visibility("default")))

#define INSTRUCTIONS baseline
#include "variant.h"
#undef INSTRUCTIONS

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define WIDER_VARIANTS

#pragma GCC push_options
#pragma GCC target("avx2,fma")
#define INSTRUCTIONS avx2
#include "variant.h"
#undef INSTRUCTIONS
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,prefer-vector-width=512")
#define INSTRUCTIONS avx512
#include "variant.h"
#undef INSTRUCTIONS
#pragma GCC pop_options
#endif

/* How many of the variants baseline, avx2, avx512, in this order, the processor has. */
EXPORT int kernel_variants(void)
{
#ifdef WIDER_VARIANTS
    __builtin_cpu_init();
    if (!(__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")))
        return 1;
    if (!(__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
          __builtin_cpu_supports("avx512bw")))
        return 2;
    return 3;
#else
    return 1;
#endif
}
