/* Products of symmetric tensors in a block of integration points. */

#ifndef SYMMETRIC_MACROS
#define SYMMETRIC_MACROS
/* Where the entry (c, d) of a symmetric 6 x 6 matrix stands in its upper triangle, by rows. */
#define PAIR_OF(c, d) ((c) <= (d) ? (c) * VOIGT - (c) * ((c) - 1) / 2 + (d) - (c) : (d) * VOIGT - (d) * ((d) - 1) / 2 + (c) - (d))
#endif

/* A:B of symmetric A and B. */
static inline void VARIANT(contract)(const double (*left)[LANES], const double (*right)[LANES], double *product)
{
    LANE product[l] = left[0][l] * right[0][l] + left[1][l] * right[1][l] + left[2][l] * right[2][l] +
                      2.0 * (left[3][l] * right[3][l] + left[4][l] * right[4][l] + left[5][l] * right[5][l]);
}

/* Adds f A to the stress. */
static inline void VARIANT(add_scaled)(const double *factor, const double (*tensor)[LANES], double (*stress)[LANES])
{
    for (int c = 0; c < VOIGT; c++)
        LANE stress[c][l] += factor[l] * tensor[c][l];
}

/* Adds f (A B + B A) to a symmetric tensor. */
static inline void VARIANT(add_products)(double factor, const double (*left)[LANES], const double (*right)[LANES],
                                         double (*sum)[LANES])
{
    for (int c = 0; c < VOIGT; c++)
        for (int k = 0; k < 3; k++) {
            int ik = VOIGT_OF[VOIGT_ROW[c]][k], kj = VOIGT_OF[k][VOIGT_COLUMN[c]];
            LANE sum[c][l] += factor * (left[ik][l] * right[kj][l] + right[ik][l] * left[kj][l]);
        }
}

/* Adds f A(x)A to the tangent. */
static inline void VARIANT(add_dyad)(const double *factor, const double (*tensor)[LANES], double (*tangent)[LANES])
{
    for (int c = 0; c < VOIGT; c++)
        for (int d = c; d < VOIGT; d++)
            LANE tangent[PAIR_OF(c, d)][l] += factor[l] * tensor[c][l] * tensor[d][l];
}

/* Adds f (A(x)B + B(x)A) to the tangent. */
static inline void VARIANT(add_dyads)(const double *factor, const double (*left)[LANES], const double (*right)[LANES],
                                      double (*tangent)[LANES])
{
    for (int c = 0; c < VOIGT; c++)
        for (int d = c; d < VOIGT; d++)
            LANE tangent[PAIR_OF(c, d)][l] += factor[l] * (left[c][l] * right[d][l] + right[c][l] * left[d][l]);
}

/* Adds f (A.B + B.A), that is f/2 (A_ik B_jl + A_il B_jk + B_ik A_jl + B_il A_jk)/2 doubled, to the tangent: of A = B it
   is 2 f times the symmetric product of A with itself. */
static inline void VARIANT(add_symmetric)(const double *factor, const double (*left)[LANES], const double (*right)[LANES],
                                          double (*tangent)[LANES])
{
    for (int c = 0; c < VOIGT; c++)
        for (int d = c; d < VOIGT; d++) {
            int i = VOIGT_ROW[c], j = VOIGT_COLUMN[c], k = VOIGT_ROW[d], m = VOIGT_COLUMN[d];
            int ik = VOIGT_OF[i][k], jm = VOIGT_OF[j][m], im = VOIGT_OF[i][m], jk = VOIGT_OF[j][k];
            LANE tangent[PAIR_OF(c, d)][l] += 0.5 * factor[l] *
                                              (left[ik][l] * right[jm][l] + left[im][l] * right[jk][l] +
                                               right[ik][l] * left[jm][l] + right[im][l] * left[jk][l]);
        }
}
