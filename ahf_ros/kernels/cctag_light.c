/* The light about CCTags: slopes and edges, each a part of a circle or of a straight line.

   What is printed depends on the radius only, so that values less their means on circles show the
   light, or moves of the frame. */

#include <math.h>

#include "cctag.h"
#include "kernels.h"
#include "robust.h"

enum { SMOOTH = 6, EDGES = 3, OF_EDGE = 5, UNKNOWNS = SMOOTH + 5 * EDGES };
#define SQRT_2_PI 2.50662827463100050242

/* An edge of light: direction, rad, offset, curvature, height and ln of width, in usual widths. */
struct edge {
    float cosine, sine, offset, half, narrow, height, more;
};

static struct edge edge_of(const double edge[OF_EDGE], double width)
{
    double cosine, sine, height = fabs(edge[3]) < 0.01 ? 0.01 : edge[3];
    cosine_and_sine(edge[0], &cosine, &sine);
    return (struct edge){.cosine = (float)cosine,
                         .sine = (float)sine,
                         .offset = (float)edge[1],
                         .half = (float)(edge[2] / 2),
                         .narrow = (float)(1 / (width * exponential(edge[4]))),
                         .height = (float)height,
                         .more = (float)(exponential(height) - 1)};
}

/* Steps of ln of light at an edge, in its heights: blur mixes light, and not its logarithm. */
static void add_steps(count q, const struct edge *by, float height, const float x[q],
                      const float y[q], float sum[q])
{
    for (count i = 0; i < q; i++) {
        float across = by->cosine * x[i] + by->sine * y[i] - by->offset;
        float along = by->cosine * y[i] - by->sine * x[i];
        float away = (across - by->half * (across * across + along * along)) * by->narrow;
        float share = normal_share_f(away, exponential_f(-0.5f * away * away));
        sum[i] += height * logarithm_f(1 + by->more * share) / by->height;
    }
}

void cctag_light(count k, count m, count n, const double there[k][3][3],
                 const double directions[2][m], const double radii[n], const double heights[k][5],
                 const double edges[k][3][5], const double width[k], const double blur[k],
                 const float slope[k][n], double most, float plain[k][m][n], float mixed[k][m][n],
                 float light[k][m][n], float rows[2][n])
{
    float *x = rows[0], *y = rows[1];
    double step = n > 1 ? radii[1] - radii[0] : 1;
    for (count i = 0; i < k; i++) {
        struct edge by[EDGES];
        for (int e = 0; e < EDGES; e++)
            by[e] = edge_of(edges[i][e], width[i]);
        for (count a = 0; a < m; a++) {
            float along[3], centre[3], by_x = (float)heights[i][0], by_y = (float)heights[i][1];
            for (int axis = 0; axis < 3; axis++) {
                const double *of = there[i][axis];
                along[axis] = (float)(of[0] * directions[0][a] + of[1] * directions[1][a]);
                centre[axis] = (float)of[2];
            }
            float *sum = plain[i][a], *own = mixed[i][a];
            for (count j = 0; j < n; j++) {
                float radius = (float)radii[j], scale = along[2] * radius + centre[2];
                x[j] = (along[0] * radius + centre[0]) / scale;
                y[j] = (along[1] * radius + centre[1]) / scale;
            }
            for (count j = 0; j < n; j++)
                sum[j] = by_x * x[j] + by_y * y[j];
            for (int e = 0; e < EDGES; e++)
                if (heights[i][2 + e] != 0)
                    add_steps(n, &by[e], (float)heights[i][2 + e], x, y, sum);
            /* What blur adds where light and ink change at once, to the second order. */
            float twice = (float)(blur[i] / (2 * step)), once = (float)(blur[i] / step);
            for (count j = 1; j < n - 1; j++)
                own[j] = (sum[j + 1] - sum[j - 1]) * twice * slope[i][j];
            own[0] = n > 1 ? (sum[1] - sum[0]) * once * slope[i][0] : 0;
            own[n - 1] = n > 1 ? (sum[n - 1] - sum[n - 2]) * once * slope[i][n - 1] : 0;
            for (count j = 0; j < n; j++)
                light[i][a][j] = exponential_f(held_f(sum[j] + own[j], -(float)most, (float)most));
        }
    }
}

/* Values less their weighted means on circles. */
static void less_means(count m, count n, const float weight[m][n], float values[m][n],
                       float sums[2][n])
{
    for (count j = 0; j < n; j++)
        sums[0][j] = sums[1][j] = 0;
    for (count a = 0; a < m; a++)
        for (count j = 0; j < n; j++) {
            sums[0][j] += weight[a][j] * values[a][j];
            sums[1][j] += weight[a][j];
        }
    for (count j = 0; j < n; j++)
        sums[0][j] /= sums[1][j];
    for (count a = 0; a < m; a++)
        for (count j = 0; j < n; j++)
            values[a][j] -= sums[0][j];
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

/* Solve normal equations of planes of a basis for what is to be explained. */
static void solve_planes(count m, count n, count size, const float weight[m][n],
                         float basis[UNKNOWNS][m][n], const float rest[m][n], double damping,
                         const double extra[UNKNOWNS], float weighted[m][n], float columns[n],
                         double found[UNKNOWNS])
{
    double normal[size][size];
    for (count a = 0; a < size; a++) {
        for (count i = 0; i < m; i++)
            for (count j = 0; j < n; j++)
                weighted[i][j] = weight[i][j] * basis[a][i][j];
        for (count b = a; b < size; b++)
            normal[a][b] = product(m, n, weighted, basis[b], columns);
        found[a] = product(m, n, weighted, rest, columns);
        normal[a][a] = normal[a][a] * (1 + damping) + extra[a] + 1e-7;
    }
    mirror(size, normal);
    solve(size, 1, normal, (double(*)[1])found);
}

void cctag_edges(count k, count m, count n, const float values[k][m][n],
                 const float weight[k][m][n], const float slope[k][n], const double width[k],
                 const double area[k], const double start[k][3][5], int16_t number,
                 const float places[2][m][n], const float around[4][m][n], int16_t rounds,
                 double usual_moves, const double deviations[4], double least_variance,
                 double most_moved, double most_curved, double highest, double edges[k][3][5],
                 double heights[k][9], float rest[k][m][n], double variance[k],
                 float basis[21][m][n], float planes[5][m][n], float columns[3][n])
{
    count q = m * n, e_count = number < 0 ? 0 : number > EDGES ? EDGES : number;
    const float *x = places[0][0], *y = places[1][0];
    float(*sums)[n] = columns, *column = columns[2];
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
        less_means(m, n, weight[i], changing, sums);
        for (int b = 0; b < SMOOTH; b++)
            less_means(m, n, weight[i], basis[b], sums);
        double now[EDGES][OF_EDGE], damping = 1e-3;
        for (count e = 0; e < EDGES; e++)
            for (int c = 0; c < OF_EDGE; c++)
                now[e][c] = edges[i][e][c] = e < e_count ? start[i][e][c] : 0;
        for (int b = 0; b < SMOOTH + EDGES; b++)
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
                        power[p] = exponential_f(-0.5f * (away[p] * by.narrow) *
                                                 (away[p] * by.narrow));
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
                    less_means(m, n, weight[i], basis[b], sums);
                solve_planes(m, n, size, weight[i], basis, rest[i], damping, extra, weighted,
                             column, found);
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
                less_means(m, n, weight[i], basis[SMOOTH + e], sums);
            }
            solve_planes(m, n, size, weight[i], basis, changing, 0, extra, weighted, column, found);
            for (count a = 0; a < m; a++)
                for (count j = 0; j < n; j++)
                    tried[a][j] = changing[a][j];
            for (count b = 0; b < size; b++) {
                float height = (float)found[b];
                for (count a = 0; a < m; a++)
                    for (count j = 0; j < n; j++)
                        tried[a][j] -= height * basis[b][a][j];
            }
            for (count a = 0; a < m; a++)
                for (count j = 0; j < n; j++)
                    weighted[a][j] = weight[i][a][j] * tried[a][j];
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
            for (count e = 0; e < EDGES; e++)
                for (int c = 0; c < OF_EDGE; c++)
                    edges[i][e][c] = now[e][c];
            for (count b = 0; b < size; b++)
                heights[i][b] = found[b];
        }
    }
}
