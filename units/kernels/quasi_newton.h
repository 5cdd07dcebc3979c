/* The two passes of the limited-memory BFGS method (Nocedal & Wright 2006, algorithm 7.4), around one preconditioner. */

/* A sum in eight parts, so that it is vectorised, and the same whatever the instruction set's width. */
static inline double VARIANT(dot)(int64_t size, const double *left, const double *right)
{
    double part[8] = {0.0};
    int64_t i = 0;
    for (; i + 8 <= size; i += 8)
        for (int k = 0; k < 8; k++)
            part[k] += left[i + k] * right[i + k];
    for (; i < size; i++)
        part[0] += left[i] * right[i];
    return ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7]));
}

static inline void VARIANT(add_multiple)(int64_t size, double factor, const double *what, double *to)
{
    for (int64_t i = 0; i < size; i++)
        to[i] += factor * what[i];
}

/* Before the preconditioner: `direction` comes in as the negative residual, [size]. The pairs lie in a ring of `memory`
   rows, steps[memory][size] and changes[memory][size] (of the residual); `count` are filled, `next` is written next.
   curvature[memory] are the pairs' inner products; alpha[memory] is kept for the second pass. */
EXPORT int VARIANT(quasi_newton_before)(int64_t size, int64_t memory, int64_t count, int64_t next, const double *steps,
                                        const double *changes, const double *curvature, double *alpha, double *direction)
{
    for (int64_t back = 1; back <= count; back++) {
        int64_t row = (next - back + memory) % memory;
        alpha[row] = VARIANT(dot)(size, steps + row * size, direction) / curvature[row];
        VARIANT(add_multiple)(size, -alpha[row], changes + row * size, direction);
    }
    return 1;
}

/* After it: `direction` comes in preconditioned, and leaves as the step. */
EXPORT int VARIANT(quasi_newton_after)(int64_t size, int64_t memory, int64_t count, int64_t next, const double *steps,
                                       const double *changes, const double *curvature, const double *alpha,
                                       double *direction)
{
    for (int64_t back = count; back >= 1; back--) {
        int64_t row = (next - back + memory) % memory;
        double beta = VARIANT(dot)(size, changes + row * size, direction) / curvature[row];
        VARIANT(add_multiple)(size, alpha[row] - beta, steps + row * size, direction);
    }
    return 1;
}
