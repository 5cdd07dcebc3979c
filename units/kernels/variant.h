/* What every instruction set has: the kernels, one file a concern. Included by kernels.c, several times. */

#include "vector_math.h"
#include "solid.h"
#include "quasi_newton.h"
#include "predictor.h"
#include "ionic.h"
#include "conjugate_gradients.h"
#include "monodomain.h"
