/* The ionic models: each a function of the values of its variables, [variables][stride] with the potential first, that
   gives their rates in the same order; a file a model. */

#include "ionic/aliev_panfilov.h"
#include "ionic/mitchell_schaeffer.h"
