/* Ellipses of dots in logarithmic images, by the steps along rays from their middles. */

#include <math.h>
#include <string.h>

#include "elementary.h"
#include "images.h"
#include "kernels.h"
#include "robust.h"

enum { SIZES = 20, SAMPLES = 13 };

/* Values along rays on circles about a target, the innermost first. */
static inline void circles(count h, count w, count m, count n, const int16_t log[h][w],
                           const double frame[3][3], const double rays[2][m],
                           const double radii[n], float values[n][POINTS])
{
    places at;
    float along[3][POINTS], centre[3];
    project(m, frame, rays[0], rays[1], along, centre);
    for (count a = 0; a < n; a++) {
        place(h, w, m, along, centre, (float)radii[a], &at);
        shorts_of(h, w, log, &at, m, values[a]);
    }
}

static inline float held(float step, const double counted[2])
{
    return greater_f(lesser_f(step, (float)counted[1]), (float)counted[0]);
}

void best_outlines(count h, count w, rows k, count s, const int16_t log[h][w],
                   const double points[k][2], const double scale[k], const double rays[2][24],
                   const double radii[22], const int32_t bins[s][24], const float beside[s][24],
                   const double least[s], const double counted[2], int32_t best[k][2],
                   double scores[k])
{
    float values[SIZES + 2][POINTS], steps[SIZES + 4][24] = {0}, sums[2][24][64] = {0};
    for (count b = 0; b < k; b++) {
        const double frame[3][3] = {{1, 0, points[b][0]}, {0, 1, points[b][1]}, {0, 0, 1}};
        circles(h, w, 24, SIZES + 2, log, frame, rays, radii, values);
        for (count a = 0; a < SIZES; a++)
            for (count j = 0; j < 24; j++)
                steps[a + 2][j] = held((values[a + 2][j] - values[a][j]) * (float)scale[b], counted);
        /* An outline takes the step of a bin and half of those beside it, more of the nearer one. */
        for (count a = 1; a < SIZES + 3; a++)
            for (count j = 0; j < 24; j++) {
                float before = steps[a - 1][j], after = steps[a + 1][j];
                sums[0][j][SIZES - 2 + a] = steps[a][j] + 0.5f * (before + after);
                sums[1][j][SIZES - 2 + a] = after - before;
            }
        scores[b] = counted[0], best[b][0] = best[b][1] = 0;
        for (int32_t i = 0; i < s; i++) {
            float of_sizes[SIZES] = {0};
            for (count first = 0; first < SIZES; first += 4)
                for (count j = 0; j < 24; j++) {
                    count bin = within((int64_t)SIZES + bins[i][j], 2 * SIZES + 1);
                    for (count a = first; a < first + 4; a++)
                        of_sizes[a] += sums[0][j][bin + a] + beside[i][j] * sums[1][j][bin + a];
                }
            for (int32_t a = 0; a < SIZES; a++)
                if (a >= least[i] && of_sizes[a] / 24 > scores[b])
                    scores[b] = of_sizes[a] / 24, best[b][0] = i, best[b][1] = a;
        }
    }
}

/* The radius of a dot, px, and half of a window about its ellipse: px, and least and most radii. */
static inline double radius_of(const double frame[3][3])
{
    return sqrt(fabs(frame[0][0] * frame[1][1] - frame[0][1] * frame[1][0]));
}

static inline double half_of(const double window[3], double radius)
{
    return lesser(greater(window[0] / radius, window[1]), window[2]);
}

/* How far the strongest steps of profiles across an ellipse, times a scale, lie outside of it, in
   its radii, and these steps; of gray values instead of their logarithms, if a unit is given. */
static inline void find_edges(count h, count w, count m, const int16_t log[h][w],
                              const double frame[3][3], double scale, const double rays[2][m],
                              const double places[SAMPLES], double half, const double counted[2],
                              double flat, double unit, double away[m], double strongest[m])
{
    float values[SAMPLES][POINTS], steps[SAMPLES][POINTS], brightest[POINTS];
    double radii[SAMPLES];
    for (count a = 0; a < SAMPLES; a++)
        radii[a] = 1 + places[a] * half;
    circles(h, w, m, SAMPLES, log, frame, rays, radii, values);
    for (count a = 0; a < SAMPLES && unit > 0; a++)
        for (count j = 0; j < m; j++)
            brightest[j] = a > 0 ? greater_f(brightest[j], values[a][j]) : values[a][j];
    for (count a = 0; a < SAMPLES && unit > 0; a++)
        for (count j = 0; j < m; j++)
            values[a][j] = exponential_f((values[a][j] - brightest[j]) / (float)unit);
    for (count a = 1; a + 1 < SAMPLES; a++)
        for (count j = 0; j < m; j++)
            steps[a][j] = held((values[a + 1][j] - values[a - 1][j]) * (float)scale, counted);
    for (count j = 0; j < m; j++) {
        count best = 1;
        for (count a = 2; a + 1 < SAMPLES; a++)
            best = steps[a][j] > steps[best][j] ? a : best;
        /* The top is between the steps beside it. */
        best = best < 2 ? 2 : best > SAMPLES - 3 ? SAMPLES - 3 : best;
        double before = steps[best - 1][j], step = steps[best][j], after = steps[best + 1][j];
        double shift = 0.5 * (before - after) / lesser(before - 2 * step + after, flat);
        shift = greater(lesser(shift, 1), -1);
        away[j] = half * (places[best] + shift * (places[1] - places[0]));
        strongest[j] = step;
    }
}

void moved_ellipses(count h, count w, rows k, count m, const int16_t log[h][w],
                    const double start[k][3][3], const double scale[k], const double rays[2][m],
                    const double basis[m][5], const double places[13], const double window[3],
                    const double counted[2], double flat, double least, double clear,
                    double outlier, int16_t rounds, const double prior[5], const double inlier[2],
                    double frames[k][3][3], double shares[k])
{
    double away[POINTS], strongest[POINTS], weights[POINTS], errors[POINTS], robust[POINTS];
    double products[POINTS][5][5], normal[5][5], change[5];
    memcpy(frames, start, sizeof(double[k][3][3]));
    memset(shares, 0, sizeof(double[k]));
    if (m > POINTS)
        return;
    set_products(m, 5, basis, products);
    for (count b = 0; b < k; b++) {
        double radius = radius_of(start[b]), half = half_of(window, radius);
        find_edges(h, w, m, log, start[b], scale[b], rays, places, half, counted, flat, 0, away,
                   strongest);
        memcpy(weights, strongest, sizeof(double[m]));
        double usual = greater(ranked(m, weights, m / 2), least);
        for (count j = 0; j < m; j++)
            weights[j] = strongest[j] > least ? lesser(strongest[j] / usual, 1) : 0;
        linear_fit(m, 5, away, weights, basis, products, prior, outlier, rounds, change, errors,
                   robust, normal);
        double near = greater(inlier[0], inlier[1] / radius);
        for (count j = 0; j < m; j++)
            shares[b] += (strongest[j] > clear && fabs(errors[j]) < near) / (double)m;
        for (int i = 0; i < 5; i++)
            change[i] = greater(lesser(change[i], half), -half);
        double along = 1 + change[2] + change[3], across = 1 + change[2] - change[3];
        for (int i = 0; i < 3; i++) {
            double x = start[b][i][0], y = start[b][i][1];
            frames[b][i][0] = along * x + change[4] * y;
            frames[b][i][1] = change[4] * x + across * y;
            frames[b][i][2] = start[b][i][2] + change[0] * x + change[1] * y;
        }
    }
}

void gray_sizes(count h, count w, rows k, const int16_t log[h][w], const double frames[k][3][3],
                const double polarity[k], const double rays[2][16], const double places[13],
                const double window[3], double unit, double flat, double sizes[k])
{
    double away[16], strongest[16];
    for (count b = 0; b < k; b++) {
        double half = half_of(window, radius_of(frames[b]));
        find_edges(h, w, 16, log, frames[b], polarity[b], rays, places, half,
                   (const double[2]){-1, 1}, flat, unit, away, strongest);
        sizes[b] = 1 + middle(16, away);
    }
}
