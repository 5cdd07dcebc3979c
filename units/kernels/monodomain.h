/* Substeps of the monodomain equation by the implicit-explicit method (2,2,2) of Ascher, Ruuth & Spiteri: the twin of
   electrophysiology/integration.py, where the method is written down. With A = K + G, g = gamma h, B = M + g A:

       B middle = M phi + g (f1 + s)
       B after  = M phi + h (delta f1 + (1 - delta) f2 + (1 - gamma) (s - A middle) + gamma s)

   A middle is (B middle - M middle)/g, and B middle the first right-hand side less its residual, so that each side takes one
   product with M. Nodal currents are f = M w: they go into the same product. */

#ifndef MONODOMAIN_TYPES
#define MONODOMAIN_TYPES

/* Elements that are integrated together, most points of an element, most variables of a cell. */
#define BLOCK_ELEMENTS 16
#define MOST_POINTS 4
#define MOST_VARIABLES 8

enum { DONE = 0, UNSOLVED = 1, TOO_LOW = 2, TOO_LARGE = 3 };

typedef int (*ionic_rates)(int64_t points, int64_t stride, const double *constants, const double *values, double *rates);

/* Mirrored in electrophysiology/compiled.py, and to be kept as it is there. `size` is that of vectors, filled up. */
struct monodomain {
    struct pattern pattern;
    int64_t nodes;
    int64_t elements;
    int64_t corners;
    int64_t integrated;           /* whether currents are integrated; else they are taken at the nodes */
    int64_t variables;            /* the potential and the ionic model's states */
    int64_t lumped;               /* whether the conductance is lumped */
    const double *mass;           /* [entries] */
    const double *diffusion;      /* [entries] */
    const double *node_rate;      /* [size], ionic time per ms */
    const double *conductance;    /* [elements], of unit stretch beyond 1, over (d + 1)(d + 2) */
    const int32_t *slots;         /* [elements][corners][corners], where an element's matrix lands */
    const int32_t *cells;         /* [elements][corners] */
    const double *shapes;         /* [corners][corners], of each point of the rule at each corner */
    const double *point_weights;  /* [elements][corners], weight times ionic time per ms */
    const double *constants;
    ionic_rates rates;
    double reversal;
    double tolerance;
    int64_t most_iterations;
    double activation_phi;
    double lowest_phi;
    double largest_phi;
};
#endif

/* The conductance G in `matrix` and its source phi_s G 1; returns whether any element is open. */
static int VARIANT(open_channels)(const struct monodomain *equation, const double *first, const double *last, double part,
                                  double *restrict matrix, double *restrict source)
{
    const struct pattern *pattern = &equation->pattern;
    const int corners = (int)equation->corners;
    int opened = 0;
    memset(source, 0, pattern->chunks * ROWS * sizeof *source);
    for (int64_t e = 0; e < equation->elements; e++) {
        double stretch = first[e] + part * (last[e] - first[e]);
        double conductance = equation->conductance[e] * (stretch > 1.0 ? stretch - 1.0 : 0.0);
        /* Not finite counts as open, so that it is noticed. */
        if (conductance == 0.0)
            continue;
        if (!opened)
            memset(matrix, 0, pattern->starts[pattern->chunks] * sizeof *matrix);
        opened = 1;
        const int32_t *slots = equation->slots + e * corners * corners, *cell = equation->cells + e * corners;
        const double row = (corners + 1) * conductance;
        for (int a = 0; a < corners; a++) {
            source[cell[a]] += equation->reversal * row;
            if (equation->lumped)
                matrix[slots[a * corners + a]] += row;
            else
                for (int b = 0; b < corners; b++)
                    matrix[slots[a * corners + b]] += a == b ? 2.0 * conductance : conductance;
        }
    }
    return opened;
}

/* B = M + implicit (K + G) and the inverse of its diagonal. */
static void VARIANT(system_of)(const struct monodomain *equation, const double *conductance, int opened, double implicit,
                               double *restrict system, double *restrict inverse)
{
    const int64_t entries = equation->pattern.starts[equation->pattern.chunks], size = equation->pattern.chunks * ROWS;
    const double *restrict mass = equation->mass, *restrict diffusion = equation->diffusion;
    if (opened)
        for (int64_t k = 0; k < entries; k++)
            system[k] = mass[k] + implicit * (diffusion[k] + conductance[k]);
    else
        for (int64_t k = 0; k < entries; k++)
            system[k] = mass[k] + implicit * diffusion[k];
    for (int64_t i = 0; i < size; i++)
        inverse[i] = 1.0 / system[equation->pattern.diagonal[i]];
}

/* Rates in 1/ms of all variables at the nodes; that of the potential only where currents are nodal. */
static void VARIANT(nodal_rates)(const struct monodomain *equation, const double *values, double *restrict rates)
{
    const int64_t size = equation->pattern.chunks * ROWS;
    equation->rates(size, size, equation->constants, values, rates);
    for (int64_t v = 0; v < equation->variables; v++)
        for (int64_t i = 0; i < size; i++)
            rates[v * size + i] *= equation->node_rate[i];
}

/* The load of the ionic current on elements of `corners` corners, which is a constant wherever this is called. The elements of a block lie
   side by side; the last of all stands in for those that a block lacks. */
static inline __attribute__((always_inline)) void VARIANT(integrate)(const struct monodomain *equation, const double *values,
                                                                     double *restrict load, const int corners)
{
    const int64_t size = equation->pattern.chunks * ROWS, points = corners, stride = BLOCK_ELEMENTS * corners;
    double at[MOST_VARIABLES * BLOCK_ELEMENTS * MOST_POINTS], rates[MOST_VARIABLES * BLOCK_ELEMENTS * MOST_POINTS];
    double corner[MOST_POINTS][BLOCK_ELEMENTS];
    for (int64_t begin = 0; begin < equation->elements; begin += BLOCK_ELEMENTS) {
        int64_t element[BLOCK_ELEMENTS];
        for (int e = 0; e < BLOCK_ELEMENTS; e++)
            element[e] = begin + e < equation->elements ? begin + e : equation->elements - 1;
        for (int64_t v = 0; v < equation->variables; v++) {
            for (int a = 0; a < corners; a++)
                for (int e = 0; e < BLOCK_ELEMENTS; e++)
                    corner[a][e] = values[v * size + equation->cells[element[e] * corners + a]];
            for (int p = 0; p < points; p++)
                for (int e = 0; e < BLOCK_ELEMENTS; e++) {
                    double sum = 0.0;
                    for (int a = 0; a < corners; a++)
                        sum += equation->shapes[p * corners + a] * corner[a][e];
                    at[v * stride + p * BLOCK_ELEMENTS + e] = sum;
                }
        }
        equation->rates(stride, stride, equation->constants, at, rates);
        for (int p = 0; p < points; p++)
            for (int e = 0; e < BLOCK_ELEMENTS; e++)
                rates[p * BLOCK_ELEMENTS + e] *= equation->point_weights[element[e] * points + p];
        for (int a = 0; a < corners; a++) {
            for (int e = 0; e < BLOCK_ELEMENTS; e++) {
                double sum = 0.0;
                for (int p = 0; p < points; p++)
                    sum += equation->shapes[p * corners + a] * rates[p * BLOCK_ELEMENTS + e];
                corner[a][e] = sum;
            }
            for (int e = 0; e < BLOCK_ELEMENTS && begin + e < equation->elements; e++)
                load[equation->cells[element[e] * corners + a]] += corner[a][e];
        }
    }
}

/* The load of the ionic current integrated by the rule of as many points as an element has corners, all variables being
   interpolated to its points. */
static void VARIANT(integrated_load)(const struct monodomain *equation, const double *values, double *restrict load)
{
    memset(load, 0, equation->pattern.chunks * ROWS * sizeof *load);
    if (equation->corners == 4)
        VARIANT(integrate)(equation, values, load, 4);
    else if (equation->corners == 3)
        VARIANT(integrate)(equation, values, load, 3);
    else
        VARIANT(integrate)(equation, values, load, 2);
}

/* 0, or what is wrong with the potential; report[0] is the node, report[1] the potential there. */
static int VARIANT(judged)(const struct monodomain *equation, const double *phi, double *report)
{
    int64_t lowest = 0, largest = 0;
    for (int64_t i = 0; i < equation->nodes; i++) {
        if (phi[i] < phi[lowest])
            lowest = i;
        if (!(fabs(phi[i]) <= fabs(phi[largest])) && !isnan(phi[largest]))
            largest = i;
    }
    int64_t node = phi[lowest] <= equation->lowest_phi ? lowest : largest;
    report[0] = (double)node;
    report[1] = phi[node];
    if (phi[lowest] <= equation->lowest_phi)
        return TOO_LOW;
    return fabs(phi[largest]) <= equation->largest_phi ? DONE : TOO_LARGE;
}

/* `count` substeps; `first` and `last` are the stretches of the elements at the begin and the end, `held` says that they are
   the same. `numbers` are the time and the length of a substep in ms, its ratio to the one of which the increments are,
   and the activation time of nodes without one. Changed in place: values [variables][size], increments [4][size] (see
   integration.py), activation [nodes]. `work` has 2 entries + (4 variables + 7) size numbers. Returns 0, or what went
   wrong, with the details in `report`. */
EXPORT int VARIANT(monodomain_advance)(int64_t count, int64_t held, const struct monodomain *equation, const double *numbers,
                                       const double *first, const double *last, double *restrict values,
                                       double *restrict increments, double *restrict activation, double *work,
                                       double *report)
{
    const double time = numbers[0], substep = numbers[1], not_activated = numbers[3];
    double ratio = numbers[2];
    const struct pattern *pattern = &equation->pattern;
    const int64_t size = pattern->chunks * ROWS, variables = equation->variables;
    const int64_t entries = pattern->starts[pattern->chunks];
    const double gamma = 1.0 - 1.0 / sqrt(2.0), delta = 1.0 - 1.0 / (2.0 * gamma), implicit = gamma * substep;
    double *conductance = work, *system = conductance + entries, *inverse = system + entries, *source = inverse + size;
    double *restrict early = source + size, *restrict late = early + variables * size;
    double *restrict middle = late + variables * size, *restrict after = middle + variables * size;
    double *restrict right = after + variables * size, *restrict side = right + size, *residual = side + size;
    double *solver = residual + size;
    double *restrict stage = increments, *restrict stage_before = increments + size;
    double *restrict whole = increments + 2 * size, *restrict whole_before = increments + 3 * size;
    const double *restrict phi = values;

    for (int64_t number = 0; number < count; number++) {
        if (number == 0 || !held) {
            double part = held ? 1.0 : ((double)number + 0.5) / (double)count;
            int opened = VARIANT(open_channels)(equation, first, last, part, conductance, source);
            VARIANT(system_of)(equation, conductance, opened, implicit, system, inverse);
        }
        /* The stage in the middle. */
        VARIANT(nodal_rates)(equation, values, early);
        for (int64_t i = 0; i < size; i++)
            side[i] = equation->integrated ? phi[i] : phi[i] + implicit * early[i];
        VARIANT(multiply)(pattern, equation->mass, side, right);
        if (equation->integrated) {
            VARIANT(integrated_load)(equation, values, early);
            for (int64_t i = 0; i < size; i++)
                right[i] += implicit * early[i];
        }
        for (int64_t i = 0; i < size; i++) {
            right[i] += implicit * source[i];
            side[i] = phi[i] + ratio * (2.0 * stage[i] - stage_before[i]);
            middle[i] = side[i];
        }
        if (VARIANT(conjugate_gradients)(pattern, system, inverse, right, middle, residual, solver, equation->tolerance,
                                         equation->most_iterations) < 0)
            return UNSOLVED;
        for (int64_t i = 0; i < size; i++) {
            /* The guess for the end, from here on in `after`. */
            after[i] = phi[i] + ratio * (2.0 * whole[i] - whole_before[i]) + (middle[i] - side[i]) / gamma;
            stage_before[i] = stage[i];
            stage[i] = middle[i] - phi[i];
            /* B middle */
            right[i] -= residual[i];
        }
        for (int64_t i = size; i < variables * size; i++)
            middle[i] = values[i] + implicit * early[i];
        /* The end. */
        VARIANT(nodal_rates)(equation, middle, late);
        const double share = (1.0 - gamma) / gamma;
        if (equation->integrated)
            for (int64_t i = 0; i < size; i++)
                side[i] = phi[i] + share * middle[i];
        else
            for (int64_t i = 0; i < size; i++)
                side[i] = phi[i] + share * middle[i] + substep * (delta * early[i] + (1.0 - delta) * late[i]);
        VARIANT(multiply)(pattern, equation->mass, side, residual);
        if (equation->integrated) {
            VARIANT(integrated_load)(equation, middle, late);
            for (int64_t i = 0; i < size; i++)
                residual[i] += substep * (delta * early[i] + (1.0 - delta) * late[i]);
        }
        for (int64_t i = 0; i < size; i++)
            right[i] = residual[i] + substep * source[i] - share * right[i];
        if (VARIANT(conjugate_gradients)(pattern, system, inverse, right, after, residual, solver, equation->tolerance,
                                         equation->most_iterations) < 0)
            return UNSOLVED;
        for (int64_t i = size; i < variables * size; i++)
            after[i] = values[i] + substep * (delta * early[i] + (1.0 - delta) * late[i]);
        int wrong = VARIANT(judged)(equation, after, report);
        if (wrong)
            return wrong;
        const double threshold = equation->activation_phi, begin = time + (double)number * substep;
        for (int64_t i = 0; i < equation->nodes; i++)
            if (activation[i] == not_activated && phi[i] < threshold && after[i] >= threshold)
                activation[i] = begin + substep * (threshold - phi[i]) / (after[i] - phi[i]);
        for (int64_t i = 0; i < size; i++) {
            whole_before[i] = whole[i];
            whole[i] = after[i] - phi[i];
        }
        memcpy(values, after, variables * size * sizeof *values);
        ratio = 1.0;
    }
    return DONE;
}
