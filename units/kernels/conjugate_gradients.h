/* Products with sparse matrices in chunks of ROWS rows, and conjugate gradients preconditioned by the diagonal.

   A chunk's rows are filled up to the longest of them with zeros in some column, and lie side by side: entry k of row l
   of a chunk that starts at s is at s + ROWS k + l. So ROWS sums run abreast, in the same order for every instruction
   set. Vectors are filled up with zeros to a multiple of ROWS. */

#ifndef CONJUGATE_GRADIENTS_TYPES
#define CONJUGATE_GRADIENTS_TYPES

#define ROWS 8

/* Mirrored in electrophysiology/compiled.py, and to be kept as it is there. */
struct pattern {
    int64_t chunks;
    const int32_t *starts;   /* [chunks + 1] */
    const int32_t *columns;  /* [starts[chunks]] */
    const int32_t *diagonal; /* [chunks * ROWS], where the diagonal is */
};
#endif

#define ROW for (int l = 0; l < ROWS; l++)

static inline double VARIANT(total)(const double *part)
{
    return ((part[0] + part[4]) + (part[2] + part[6])) + ((part[1] + part[5]) + (part[3] + part[7]));
}

/* y = A x; returns x.y */
static double VARIANT(multiply)(const struct pattern *pattern, const double *restrict matrix, const double *restrict x,
                                double *restrict y)
{
    const int32_t *restrict columns = pattern->columns;
    double product[ROWS] = {0.0};
    for (int64_t chunk = 0; chunk < pattern->chunks; chunk++) {
        double sum[ROWS] = {0.0};
        for (int64_t k = pattern->starts[chunk]; k < pattern->starts[chunk + 1]; k += ROWS)
            ROW sum[l] += matrix[k + l] * x[columns[k + l]];
        ROW y[chunk * ROWS + l] = sum[l];
        ROW product[l] += sum[l] * x[chunk * ROWS + l];
    }
    return VARIANT(total)(product);
}

/* Solves A x = right from the guess in x until the residual is `tolerance` times as large as `right`; leaves the residual
   in `residual`. Unless the guess is exact it is improved once at least: where the matrix is a diagonal that is exact, and
   elsewhere a solution does not hang on whether a guess has just met the tolerance. Work space of 2 vectors. Returns how many iterations it took, -1 where `most` are not enough. */
static int VARIANT(conjugate_gradients)(const struct pattern *pattern, const double *matrix, const double *restrict inverse,
                                        const double *restrict right, double *restrict x, double *restrict residual,
                                        double *work, double tolerance, int64_t most)
{
    const int64_t size = pattern->chunks * ROWS;
    double *restrict direction = work, *restrict image = work + size;
    double square[ROWS] = {0.0}, preconditioned[ROWS] = {0.0}, wanted[ROWS] = {0.0};
    VARIANT(multiply)(pattern, matrix, x, image);
    for (int64_t i = 0; i < size; i += ROWS)
        ROW {
            double r = right[i + l] - image[i + l], z = inverse[i + l] * r;
            residual[i + l] = r;
            direction[i + l] = z;
            square[l] += r * r;
            preconditioned[l] += r * z;
            wanted[l] += right[i + l] * right[i + l];
        }
    const double limit = tolerance * tolerance * VARIANT(total)(wanted);
    double rr = VARIANT(total)(square), rz = VARIANT(total)(preconditioned);
    if (VARIANT(total)(wanted) == 0.0) {
        memset(x, 0, size * sizeof *x);
        memset(residual, 0, size * sizeof *residual);
        return 0;
    }
    for (int64_t iteration = 0; iteration < most && rr < (double)INFINITY; iteration++) {
        if (rr <= limit && (iteration || rr == 0.0))
            return (int)iteration;
        const double step = rz / VARIANT(multiply)(pattern, matrix, direction, image);
        ROW square[l] = preconditioned[l] = 0.0;
        for (int64_t i = 0; i < size; i += ROWS)
            ROW {
                x[i + l] += step * direction[i + l];
                double r = residual[i + l] - step * image[i + l];
                residual[i + l] = r;
                square[l] += r * r;
                preconditioned[l] += r * r * inverse[i + l];
            }
        const double before = rz;
        rr = VARIANT(total)(square);
        rz = VARIANT(total)(preconditioned);
        const double again = rz / before;
        for (int64_t i = 0; i < size; i++)
            direction[i] = inverse[i] * residual[i] + again * direction[i];
    }
    return -1;
}
