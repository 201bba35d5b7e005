/* The light about CCTags: slopes and edges, each a part of a circle or of a straight line.

   What is printed depends on the radius only, so that values less their means on circles show the
   light, or moves of the frame. */

#include <math.h>

#include "cctag.h"
#include "kernels.h"
#include "robust.h"

enum { SMOOTH = 6, UNKNOWNS = SMOOTH + 5 * MOST_EDGES };
#define SQRT_2_PI 2.50662827463100050242

void cctag_light(count k, count m, count n, const float places[2][m][n],
                 const double heights[k][5], const double edges[k][3][5], const double width[k],
                 const double blur[k], const float slope[k][n], float plain[k][m][n],
                 float mixed[k][m][n])
{
    for (count i = 0; i < k; i++) {
        struct light light = light_of(heights[i], edges[i], width[i]);
        for (count a = 0; a < m; a++)
            light_along(n, &light, places[0][a], places[1][a], blur[i], slope[i], plain[i][a],
                        mixed[i][a]);
    }
}

/* Values less their weighted means on circles; `over` is one over the sums of weights. */
static void less_means(count m, count n, const float weight[m][n], const float over[n],
                       float values[m][n], float means[n])
{
    for (count j = 0; j < n; j++)
        means[j] = 0;
    for (count a = 0; a < m; a++)
        for (count j = 0; j < n; j++)
            means[j] += weight[a][j] * values[a][j];
    for (count j = 0; j < n; j++)
        means[j] *= over[j];
    for (count a = 0; a < m; a++)
        for (count j = 0; j < n; j++)
            values[a][j] -= means[j];
}

/* Weighted sum of products, in columns of single precision. */
static double product(count m, count n, const float weighted[m][n], const float values[m][n],
                      float columns[n])
{
    double sum = 0;
    for (count j = 0; j < n; j++)
        columns[j] = 0;
    for (count a = 0; a < m; a++)
        for (count j = 0; j < n; j++)
            columns[j] += weighted[a][j] * values[a][j];
    for (count j = 0; j < n; j++)
        sum += columns[j];
    return sum;
}

static void multiply(count q, const float weight[q], const float values[q], float weighted[q])
{
    for (count p = 0; p < q; p++)
        weighted[p] = weight[p] * values[p];
}

/* Set the products of planes of a basis with the first of some, which those before have already. */
static void set_normal(count m, count n, count first, count size, const float weight[m][n],
                       float basis[UNKNOWNS][m][n], float weighted[m][n], float columns[n],
                       double normal[UNKNOWNS][UNKNOWNS])
{
    for (count a = first; a < size; a++) {
        multiply(m * n, weight[0], basis[a][0], weighted[0]);
        for (count b = 0; b <= a; b++)
            normal[b][a] = normal[a][b] = product(m, n, weighted, basis[b], columns);
    }
}

/* Solve normal equations of planes of a basis for what is to be explained. */
static void solve_planes(count m, count n, count size, const float weight[m][n],
                         float basis[UNKNOWNS][m][n], const float rest[m][n],
                         double known[UNKNOWNS][UNKNOWNS], double damping,
                         const double extra[UNKNOWNS], float weighted[m][n], float columns[n],
                         double found[UNKNOWNS])
{
    double normal[size][size];
    set_normal(m, n, SMOOTH, size, weight, basis, weighted, columns, known);
    multiply(m * n, weight[0], rest[0], weighted[0]);
    for (count a = 0; a < size; a++) {
        for (count b = 0; b < size; b++)
            normal[a][b] = known[a][b];
        found[a] = product(m, n, weighted, basis[a], columns);
        normal[a][a] = normal[a][a] * (1 + damping) + extra[a] + 1e-7;
    }
    solve(size, 1, normal, (double(*)[1])found);
}

void cctag_edges(rows k, count m, count n, const float values[k][m][n],
                 const float weight[k][m][n], const float slope[k][n], const double width[k],
                 const double area[k], const double start[k][3][5], int16_t number,
                 const float places[2][m][n], const float around[4][m][n], int16_t rounds,
                 double usual_moves, const double deviations[4], double least_variance,
                 double most_moved, double most_curved, double highest, double edges[k][3][5],
                 double heights[k][9], float rest[k][m][n], double variance[k],
                 float basis[21][m][n], float planes[5][m][n], float columns[3][n])
{
    count q = m * n, e_count = number < 0 ? 0 : number > MOST_EDGES ? MOST_EDGES : number;
    const float *x = places[0][0], *y = places[1][0];
    float *means = columns[0], *over = columns[1], *column = columns[2];
    double normal[UNKNOWNS][UNKNOWNS];
    float(*changing)[n] = planes[0], (*tried)[n] = planes[1], (*weighted)[n] = planes[2];
    float *power = planes[3][0], *away = planes[4][0];
    for (count i = 0; i < k; i++) {
        for (count a = 0; a < m; a++)
            for (count j = 0; j < n; j++) {
                changing[a][j] = values[i][a][j];
                basis[0][a][j] = places[0][a][j];
                basis[1][a][j] = places[1][a][j];
                for (int b = 0; b < 4; b++)
                    basis[2 + b][a][j] = -slope[i][j] * around[b][a][j];
            }
        for (count j = 0; j < n; j++) {
            float sum = 0;
            for (count a = 0; a < m; a++)
                sum += weight[i][a][j];
            over[j] = 1 / sum;
        }
        less_means(m, n, weight[i], over, changing, means);
        for (int b = 0; b < SMOOTH; b++)
            less_means(m, n, weight[i], over, basis[b], means);
        set_normal(m, n, 0, SMOOTH, weight[i], basis, weighted, column, normal);
        double now[MOST_EDGES][OF_EDGE], damping = 1e-3;
        for (count e = 0; e < MOST_EDGES; e++)
            for (int c = 0; c < OF_EDGE; c++)
                now[e][c] = edges[i][e][c] = e < e_count ? start[i][e][c] : 0;
        for (int b = 0; b < SMOOTH + MOST_EDGES; b++)
            heights[i][b] = 0;
        for (int round = 0; round <= rounds; round++) {
            double found[UNKNOWNS], extra[UNKNOWNS] = {0};
            if (round) { /* Levenberg and Marquardt, from the best edges */
                count size = SMOOTH + 5 * e_count;
                for (count e = 0; e < e_count; e++) {
                    struct edge by = edge_of(edges[i][e], width[i]);
                    float *step = basis[SMOOTH + 4 * e_count + e][0], *change[4];
                    for (int c = 0; c < 4; c++)
                        change[c] = basis[SMOOTH + 4 * e + c][0];
                    float gain = (float)(heights[i][SMOOTH + e] * by.narrow / SQRT_2_PI);
                    float curved = 2 * by.half, turning = 1 + curved * by.offset;
                    for (count p = 0; p < q; p++) {
                        float across = by.cosine * x[p] + by.sine * y[p] - by.offset;
                        float along = by.cosine * y[p] - by.sine * x[p];
                        away[p] = across - by.half * (across * across + along * along);
                        power[p] = bell_f(away[p] * by.narrow);
                    }
                    for (count p = 0; p < q; p++) {
                        float share = normal_share_f(away[p] * by.narrow, power[p]);
                        float light = 1 + by.more * share;
                        step[p] = logarithm_f(light) / by.height;
                        power[p] *= gain * (by.more / by.height / light);
                    }
                    for (count p = 0; p < q; p++)
                        change[3][p] = -away[p] * power[p];
                    for (count p = 0; p < q; p++)
                        change[0][p] = power[p] * (by.cosine * y[p] - by.sine * x[p]) * turning;
                    for (count p = 0; p < q; p++) {
                        float across = by.cosine * x[p] + by.sine * y[p] - by.offset;
                        float along = by.cosine * y[p] - by.sine * x[p];
                        change[1][p] = power[p] * (curved * across - 1);
                        change[2][p] = power[p] * (across * across + along * along) * -0.5f;
                    }
                    for (int c = 0; c < 4; c++)
                        extra[SMOOTH + 4 * e + c] = variance[i] / area[i] / squared(deviations[c]);
                }
                for (count b = SMOOTH; b < size; b++)
                    less_means(m, n, weight[i], over, basis[b], means);
                solve_planes(m, n, size, weight[i], basis, rest[i], normal, damping, extra,
                             weighted, column, found);
                for (count e = 0; e < e_count; e++) {
                    static const int moving[4] = {0, 1, 2, 4};
                    for (int c = 0; c < 4; c++)
                        now[e][moving[c]] = edges[i][e][moving[c]] +
                                            held(found[SMOOTH + 4 * e + c], -most_moved, most_moved);
                    now[e][2] = held(now[e][2], -most_curved, most_curved);
                    now[e][3] = held(heights[i][SMOOTH + e], -highest, highest);
                }
            }
            count size = SMOOTH + e_count;
            for (int b = 0; b < UNKNOWNS; b++)
                extra[b] = b >= 2 && b < SMOOTH ? usual_moves : 0;
            for (count e = 0; e < e_count; e++) {
                struct edge by = edge_of(now[e], width[i]);
                float *step = basis[SMOOTH + e][0];
                for (count p = 0; p < q; p++)
                    step[p] = 0;
                add_steps(q, &by, 1, x, y, step);
                less_means(m, n, weight[i], over, basis[SMOOTH + e], means);
            }
            solve_planes(m, n, size, weight[i], basis, changing, normal, 0, extra, weighted, column,
                         found);
            for (count a = 0; a < m; a++)
                for (count j = 0; j < n; j++)
                    tried[a][j] = changing[a][j];
            for (count b = 0; b < size; b++) {
                float height = (float)found[b];
                for (count a = 0; a < m; a++)
                    for (count j = 0; j < n; j++)
                        tried[a][j] -= height * basis[b][a][j];
            }
            multiply(q, weight[i][0], tried[0], weighted[0]);
            double left = product(m, n, weighted, tried, column) + least_variance;
            bool better = !round || left < variance[i];
            if (round)
                damping = better ? greater(damping / 5, 1e-4) : 10 * damping;
            if (!better)
                continue;
            variance[i] = left;
            for (count a = 0; a < m; a++)
                for (count j = 0; j < n; j++)
                    rest[i][a][j] = tried[a][j];
            for (count e = 0; e < MOST_EDGES; e++)
                for (int c = 0; c < OF_EDGE; c++)
                    edges[i][e][c] = now[e][c];
            for (count b = 0; b < size; b++)
                heights[i][b] = found[b];
        }
    }
}
