/* The discretised solid: energy, residual force and tangent, a block of LANES integration points at a time.

   A point carries the gradients of its element's shape functions, its weight and its directions; of linear tetrahedra
   there is one an element. All arrays of points are in blocks, the point within the block being the last index:
   gradients[block][node][direction][lane]. Points that fill up the last block have the weight 0. */

#ifndef SOLID_TYPES
#define SOLID_TYPES

#define LANES 16
#define MOST_NODES 10

/* Components of symmetric tensors: 11, 22, 33, 12, 23, 13. Of symmetric matrices of those: the upper triangle by rows. */
#define VOIGT 6
#define VOIGT_PAIRS 21
static const int VOIGT_OF[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
static const int VOIGT_ROW[VOIGT] = {0, 1, 2, 0, 1, 0};
static const int VOIGT_COLUMN[VOIGT] = {0, 1, 2, 1, 2, 2};

struct strain {
    double gradient[9][LANES];            /* F, by rows */
    double cauchy_green[VOIGT][LANES];    /* C */
    double inverse[VOIGT][LANES];         /* its inverse */
    double volume_ratio[LANES];           /* J */
    double log_volume[LANES];             /* ln J */
    double structure[VOIGT][LANES];       /* a0 (x) a0 of the fibre */
    double sheet_structure[VOIGT][LANES]; /* s0 (x) s0 of the sheet */
};

struct response {
    double energy[LANES];                 /* MPa */
    double stress[VOIGT][LANES];          /* S = 2 dW/dC */
    double tangent[VOIGT_PAIRS][LANES];   /* 4 d2W/dC2 */
};

/* Mirrored in mechanics/compiled_bulk.py, and to be kept as it is there. */
struct solid {
    int64_t blocks;
    int64_t element_nodes;                /* 4 or 10 */
    const int32_t *nodes;                 /* [blocks][element_nodes][LANES] */
    const double *gradients;              /* [blocks][element_nodes][3][LANES], 1/mm */
    const double *weights;                /* [blocks][LANES], mm3 */
    const double *fiber;                  /* [blocks][3][LANES] */
    const double *sheet;                  /* [blocks][3][LANES] */
    const double *active;                 /* [blocks][VOIGT][LANES], stress for each unit of active stress */
    const double *vertex_shares;          /* [blocks][4][LANES], how the nodal active stress enters; NULL: a quarter each */
    int64_t laws;
    const int32_t *law;                   /* [laws], see laws.h */
    const double *law_parameters;         /* [laws][LAW_PARAMETERS] */
};
#endif

#define LANE for (int l = 0; l < LANES; l++)

#include "symmetric.h"
#include "laws.h"

static inline void VARIANT(deform)(const struct solid *solid, int64_t block, int element_nodes, const double *displacement,
                                   struct strain *at)
{
    const double *gradients = solid->gradients + block * element_nodes * 3 * LANES;
    const int32_t *nodes = solid->nodes + block * element_nodes * LANES;
    double (*F)[LANES] = at->gradient;
    for (int i = 0; i < 9; i++)
        LANE F[i][l] = i % 4 == 0 ? 1.0 : 0.0;
    for (int a = 0; a < element_nodes; a++) {
        double moved[3][LANES];
        LANE {
            const double *u = displacement + 3 * (int64_t)nodes[a * LANES + l];
            moved[0][l] = u[0];
            moved[1][l] = u[1];
            moved[2][l] = u[2];
        }
        const double *g = gradients + a * 3 * LANES;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                LANE F[3 * i + j][l] += moved[i][l] * g[j * LANES + l];
    }
    double (*C)[LANES] = at->cauchy_green, (*inverse)[LANES] = at->inverse;
    LANE {
        double determinant = F[0][l] * (F[4][l] * F[8][l] - F[5][l] * F[7][l]) -
                             F[1][l] * (F[3][l] * F[8][l] - F[5][l] * F[6][l]) +
                             F[2][l] * (F[3][l] * F[7][l] - F[4][l] * F[6][l]);
        double c11 = F[0][l] * F[0][l] + F[3][l] * F[3][l] + F[6][l] * F[6][l];
        double c22 = F[1][l] * F[1][l] + F[4][l] * F[4][l] + F[7][l] * F[7][l];
        double c33 = F[2][l] * F[2][l] + F[5][l] * F[5][l] + F[8][l] * F[8][l];
        double c12 = F[0][l] * F[1][l] + F[3][l] * F[4][l] + F[6][l] * F[7][l];
        double c23 = F[1][l] * F[2][l] + F[4][l] * F[5][l] + F[7][l] * F[8][l];
        double c13 = F[0][l] * F[2][l] + F[3][l] * F[5][l] + F[6][l] * F[8][l];
        double scale = 1.0 / (determinant * determinant);
        C[0][l] = c11, C[1][l] = c22, C[2][l] = c33, C[3][l] = c12, C[4][l] = c23, C[5][l] = c13;
        inverse[0][l] = (c22 * c33 - c23 * c23) * scale;
        inverse[1][l] = (c11 * c33 - c13 * c13) * scale;
        inverse[2][l] = (c11 * c22 - c12 * c12) * scale;
        inverse[3][l] = (c13 * c23 - c12 * c33) * scale;
        inverse[4][l] = (c12 * c13 - c11 * c23) * scale;
        inverse[5][l] = (c12 * c23 - c13 * c22) * scale;
        at->volume_ratio[l] = determinant;
        at->log_volume[l] = VARIANT(logarithm)(determinant);
    }
    const double *fiber = solid->fiber + block * 3 * LANES, *sheet = solid->sheet + block * 3 * LANES;
    for (int c = 0; c < VOIGT; c++)
        LANE {
            at->structure[c][l] = fiber[VOIGT_ROW[c] * LANES + l] * fiber[VOIGT_COLUMN[c] * LANES + l];
            at->sheet_structure[c][l] = sheet[VOIGT_ROW[c] * LANES + l] * sheet[VOIGT_COLUMN[c] * LANES + l];
        }
}

/* Stress, and energy and tangent where they are wanted, of all laws and of the active stress. */
static inline void VARIANT(respond)(const struct solid *solid, int64_t block, int element_nodes, const double *tension,
                                    const struct strain *at, int with_energy, int with_tangent, struct response *response)
{
    memset(response->energy, 0, sizeof response->energy);
    memset(response->stress, 0, sizeof response->stress);
    if (with_tangent)
        memset(response->tangent, 0, sizeof response->tangent);
    for (int64_t k = 0; k < solid->laws; k++)
        VARIANT(law)(solid->law[k], solid->law_parameters + k * LAW_PARAMETERS, at, with_energy, with_tangent, response);

    /* The active stress has the potential s_a A:C/2 and does not depend on the deformation. */
    const int32_t *nodes = solid->nodes + block * element_nodes * LANES;
    const double *shares = solid->vertex_shares ? solid->vertex_shares + block * 4 * LANES : NULL;
    const double *active = solid->active + block * VOIGT * LANES;
    double here[LANES] = {0.0};
    for (int a = 0; a < 4; a++)
        LANE here[l] += (shares ? shares[a * LANES + l] : 0.25) * tension[nodes[a * LANES + l]];
    for (int c = 0; c < VOIGT; c++)
        LANE response->stress[c][l] += here[l] * active[c * LANES + l];
    if (with_energy)
        for (int c = 0; c < VOIGT; c++) {
            double times = c < 3 ? 0.5 : 1.0;
            LANE response->energy[l] += times * here[l] * active[c * LANES + l] * at->cauchy_green[c][l];
        }
}

static inline double VARIANT(forces)(const struct solid *solid, int element_nodes, const double *displacement,
                                     const double *tension, double *energy, double *force)
{
    struct strain at;
    struct response response;
    double smallest = INFINITY, total = 0.0;
    for (int64_t block = 0; block < solid->blocks; block++) {
        VARIANT(deform)(solid, block, element_nodes, displacement, &at);
        int sound = 1;
        for (int l = 0; l < LANES; l++) {
            sound &= at.volume_ratio[l] > 0.0;
            smallest = at.volume_ratio[l] < smallest ? at.volume_ratio[l] : smallest;
        }
        if (!sound)
            return -INFINITY;
        VARIANT(respond)(solid, block, element_nodes, tension, &at, energy != NULL, 0, &response);
        const double *weights = solid->weights + block * LANES;
        const double *gradients = solid->gradients + block * element_nodes * 3 * LANES;
        const int32_t *nodes = solid->nodes + block * element_nodes * LANES;
        if (energy)
            for (int l = 0; l < LANES; l++)
                total += weights[l] * response.energy[l];
        double first_piola[9][LANES];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                LANE first_piola[3 * i + j][l] =
                    weights[l] * (at.gradient[3 * i][l] * response.stress[VOIGT_OF[0][j]][l] +
                                  at.gradient[3 * i + 1][l] * response.stress[VOIGT_OF[1][j]][l] +
                                  at.gradient[3 * i + 2][l] * response.stress[VOIGT_OF[2][j]][l]);
        for (int a = 0; a < element_nodes; a++) {
            const double *g = gradients + a * 3 * LANES;
            double part[3][LANES];
            for (int i = 0; i < 3; i++)
                LANE part[i][l] = first_piola[3 * i][l] * g[l] + first_piola[3 * i + 1][l] * g[LANES + l] +
                                  first_piola[3 * i + 2][l] * g[2 * LANES + l];
            for (int l = 0; l < LANES; l++) {
                double *at_node = force + 3 * (int64_t)nodes[a * LANES + l];
                at_node[0] += part[0][l];
                at_node[1] += part[1][l];
                at_node[2] += part[2][l];
            }
        }
    }
    if (energy)
        *energy = total;
    return smallest;
}

/* Adds the forces (N) of all points to `force`, [nodes][3], and writes the energy (N mm) unless it is NULL. The smallest J
   of the points goes to `smallest`; minus infinity says that one is not positive, and that forces and energy are not
   complete. */
EXPORT int VARIANT(solid_forces)(const struct solid *solid, const double *displacement, const double *tension,
                                 double *energy, double *force, double *smallest)
{
    *smallest = solid->element_nodes == 4 ? VARIANT(forces)(solid, 4, displacement, tension, energy, force)
                                          : VARIANT(forces)(solid, MOST_NODES, displacement, tension, energy, force);
    return *smallest > 0.0;
}

static inline void VARIANT(stiffness)(const struct solid *solid, int element_nodes, const double *displacement,
                                      const double *tension, const int32_t *slots, double *matrix)
{
    struct strain at;
    struct response response;
    int pairs = element_nodes * (element_nodes + 1) / 2;
    for (int64_t block = 0; block < solid->blocks; block++) {
        VARIANT(deform)(solid, block, element_nodes, displacement, &at);
        VARIANT(respond)(solid, block, element_nodes, tension, &at, 0, 1, &response);
        const double *weights = solid->weights + block * LANES;
        const double *gradients = solid->gradients + block * element_nodes * 3 * LANES;
        const int32_t *slot = slots + block * pairs * LANES;

        /* B: strain (engineering shears) by the three displacements of a node; D B weighted. */
        double strain_of[MOST_NODES][3][VOIGT][LANES], stress_of[3][VOIGT][LANES], initial[3][LANES];
        for (int a = 0; a < element_nodes; a++) {
            const double *g = gradients + a * 3 * LANES;
            for (int k = 0; k < 3; k++)
                for (int c = 0; c < VOIGT; c++) {
                    int i = VOIGT_ROW[c], j = VOIGT_COLUMN[c];
                    const double *Fki = at.gradient[3 * k + i], *Fkj = at.gradient[3 * k + j];
                    if (i == j)
                        LANE strain_of[a][k][c][l] = Fki[l] * g[i * LANES + l];
                    else
                        LANE strain_of[a][k][c][l] = Fki[l] * g[j * LANES + l] + Fkj[l] * g[i * LANES + l];
                }
        }
        int pair = 0;
        for (int a = 0; a < element_nodes; a++) {
            const double *g = gradients + a * 3 * LANES;
            for (int k = 0; k < 3; k++)
                for (int c = 0; c < VOIGT; c++) {
                    LANE stress_of[k][c][l] = 0.0;
                    for (int d = 0; d < VOIGT; d++) {
                        const double *D = response.tangent[PAIR_OF(c, d)];
                        LANE stress_of[k][c][l] += D[l] * strain_of[a][k][d][l];
                    }
                    LANE stress_of[k][c][l] *= weights[l];
                }
            for (int i = 0; i < 3; i++)
                LANE initial[i][l] = weights[l] * (response.stress[VOIGT_OF[i][0]][l] * g[l] +
                                                   response.stress[VOIGT_OF[i][1]][l] * g[LANES + l] +
                                                   response.stress[VOIGT_OF[i][2]][l] * g[2 * LANES + l]);
            for (int b = 0; b <= a; b++, pair++) {
                const double *other = gradients + b * 3 * LANES;
                double block_of[9][LANES];
                for (int k = 0; k < 3; k++)
                    for (int m = 0; m < 3; m++) {
                        double *entry = block_of[3 * k + m];
                        LANE entry[l] = stress_of[k][0][l] * strain_of[b][m][0][l];
                        for (int c = 1; c < VOIGT; c++)
                            LANE entry[l] += stress_of[k][c][l] * strain_of[b][m][c][l];
                        if (k == m)
                            LANE entry[l] += initial[0][l] * other[l] + initial[1][l] * other[LANES + l] +
                                             initial[2][l] * other[2 * LANES + l];
                    }
                for (int l = 0; l < LANES; l++) {
                    /* A negative slot says that the block belongs above the diagonal, where its transpose is kept. */
                    int32_t place = slot[pair * LANES + l];
                    double *entry = matrix + 9 * (int64_t)(place >= 0 ? place : -1 - place);
                    if (place >= 0)
                        for (int i = 0; i < 9; i++)
                            entry[i] += block_of[i][l];
                    else
                        for (int i = 0; i < 3; i++)
                            for (int j = 0; j < 3; j++)
                                entry[3 * i + j] += block_of[3 * j + i][l];
                }
            }
        }
    }
}

/* Adds the derivative of the forces by the displacements (N/mm) to `matrix`, blocks of 3 x 3 of the lower triangle, by
   `slots`, [blocks][pairs of nodes][LANES]: the pairs (a, b), b <= a, of an element's nodes. All J have to be positive. */
EXPORT int VARIANT(solid_tangent)(const struct solid *solid, const double *displacement, const double *tension,
                                  const int32_t *slots, double *matrix)
{
    if (solid->element_nodes == 4)
        VARIANT(stiffness)(solid, 4, displacement, tension, slots, matrix);
    else
        VARIANT(stiffness)(solid, MOST_NODES, displacement, tension, slots, matrix);
    return 1;
}

/* The squared stretch along the fibre at every point, [blocks][LANES]. */
EXPORT int VARIANT(solid_stretch_squared)(const struct solid *solid, const double *displacement, double *squared)
{
    struct strain at;
    for (int64_t block = 0; block < solid->blocks; block++) {
        VARIANT(deform)(solid, block, (int)solid->element_nodes, displacement, &at);
        VARIANT(contract)(at.structure, at.cauchy_green, squared + block * LANES);
    }
    return 1;
}

#undef LANE
