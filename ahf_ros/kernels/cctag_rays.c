/* Rays from the centres of CCTags, less their light, as linear functions of the ink of rings. */

#include <math.h>

#include "cctag.h"
#include "images.h"
#include "kernels.h"
#include "robust.h"

enum { CHANGES = 6, BASIS = 2 + CHANGES, PAIRS = BASIS * (BASIS + 1) / 2, SOME = 12, UNKNOWNS = 10 };
/* What changes the ink, by which unknown: powers of the radius, and edges. */
static const int CHANGED[UNKNOWNS] = {0, 0, 1, 1, 1, 2, 2, 3, 4, 5};

/* Where a frame, or one that is brought to the plane of another, has points of a ray. */
static void points_along(count n, const double frame[3][3], double x, double y,
                         const double radii[n], float at[2][n])
{
    float along[3], centre[3];
    for (int axis = 0; axis < 3; axis++) {
        along[axis] = (float)(frame[axis][0] * x + frame[axis][1] * y);
        centre[axis] = (float)frame[axis][2];
    }
    for (count j = 0; j < n; j++) {
        float radius = (float)radii[j], scale = along[2] * radius + centre[2];
        at[0][j] = (along[0] * radius + centre[0]) / scale;
        at[1][j] = (along[1] * radius + centre[1]) / scale;
    }
}

/* Values at increasing radii, interpolated between others; beyond these the last one counts. */
static void interpolate(count s, count n, const double known[s], const float values[s],
                        const double radii[n], float between[n])
{
    for (count j = 0, i = 0; j < n; j++) {
        while (i + 2 < s && radii[j] >= known[i + 1])
            i++;
        count next = i + (i + 1 < s);
        double share = next > i ? (radii[j] - known[i]) / (known[next] - known[i]) : 0;
        between[j] = (float)(values[i] + held(share, 0, 1) * (values[next] - values[i]));
    }
}

/* Gray values along a ray, not below 0. */
static void gray_along(count h, count w, count n, const float gray[h][w], const float at[2][n],
                       float values[n])
{
    places of;
    for (count start = 0; start < n; start += POINTS) {
        count some = n - start < POINTS ? n - start : POINTS;
        hold(h, w, some, &at[0][start], &at[1][start], &of);
        for (count j = 0; j < some; j++)
            values[start + j] = greater_f(value_of(h, w, gray, &of, j), 0);
    }
}

/* Shares of what interpolation mixes with a place of a ray, as that far away does: the variance of
   linear interpolation along the ray, of the distance's square. */
static void mixed_along(count h, count w, count n, const double frame[3][3], double distance,
                        const float at[2][n], float mixed[n])
{
    for (count j = 0; j < n; j++) {
        struct pixels of = pixels_at(h, w, at[0][j], at[1][j]);
        double x = squared(at[0][j] - frame[0][2]), y = squared(at[1][j] - frame[1][2]);
        double variance = x * of.across * (1 - of.across) + y * of.down * (1 - of.down);
        mixed[j] = (float)(variance / greater((x + y) * squared(distance), 1e-12));
    }
}

void cctag_lit(count h, count w, rows k, count m, count n, count s, const float gray[h][w],
               const double frames[k][3][3], const double directions[2][m], const double radii[n],
               const double lights[k][3][3], const double heights[k][5],
               const double edges[k][3][5], const double width[k],
               const double blur[k], const float slope[k][s], const double known[s], double most,
               const double limits[2], double white, double many, double interpolated,
               float values[k][m][n], float highest[k][m][n], float mixed[k][m][n],
               int32_t apart[k], float rows[5][n])
{
    float lowest = (float)limits[0], brightest = (float)limits[1];
    double spacing = n > 1 ? radii[1] - radii[0] : 1;
    float *plain = rows[2], *change = rows[3], *own_slope = rows[4];
    for (count i = 0; i < k; i++) {
        const double(*f)[3] = frames[i];
        double back[3][3], there[3][3];
        inverted(lights[i], back);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                there[a][b] = dot(3, back[a], (double[3]){f[0][b], f[1][b], f[2][b]});
        struct light light = light_of(heights[i], edges[i], width[i]);
        interpolate(s, n, known, slope[i], radii, own_slope);
        count beyond = 0;
        for (count a = 0; a < m; a++) {
            double x = directions[0][a], y = directions[1][a];
            float *seen = values[i][a], *most_seen = highest[i][a], sum = 0;
            points_along(n, f, x, y, radii, rows);
            gray_along(h, w, n, gray, (const float(*)[n])rows, seen);
            for (count j = 0; j < n; j++)
                beyond += (seen[j] <= lowest) | (seen[j] >= brightest);
            points_along(n, there, x, y, radii, rows);
            light_along(n, &light, rows[0], rows[1], blur[i] / spacing, own_slope, plain, change);
            for (count j = 0; j < n; j++) {
                float ln = held_f(plain[j] + change[j], -(float)most, (float)most);
                most_seen[j] = exponential_f(ln);
                seen[j] /= most_seen[j];
            }
            for (count j = 0; j < n; j++)
                sum += seen[j];
            float own = greater_f(sum / (float)n, 1e-3f);
            for (count j = 0; j < n; j++) {
                seen[j] /= own;
                most_seen[j] = (float)white / (most_seen[j] * own);
            }
        }
        apart[i] = 0;
        if (beyond <= many * (double)(m * n))
            continue;
        double area = (f[0][0] - f[0][2] * f[2][0]) * (f[1][1] - f[1][2] * f[2][1]) -
                      (f[0][1] - f[0][2] * f[2][1]) * (f[1][0] - f[1][2] * f[2][0]);
        double step = spacing * sqrt(fabs(area));
        apart[i] = (int32_t)held(interpolated / step + 0.5, 1, (double)n);
        for (count a = 0; a < m; a++) {
            points_along(n, f, directions[0][a], directions[1][a], radii, rows);
            mixed_along(h, w, n, f, apart[i] * step, (const float(*)[n])rows, mixed[i][a]);
        }
    }
}

/* A ray, and ink along it. */
struct ray {
    const float *seen, *ink, *highest, *mixed;
    count apart;
    double least_gain;
    int rounds_of_clipped;
    float *weight, *model, *errors, *gain;
};

/* Fit paper + step ink; return the step, and the contrast of ink, below 0 where it is darker. */
static void fit_line(count n, const float values[n], const float weight[n], const float ink[n],
                     float model[n], double *step, double *contrast)
{
    float total = 0, of_ink = 0, of_square = 0, of_values = 0, of_both = 0;
    for (count j = 0; j < n; j++) {
        float weighted = weight[j] * ink[j];
        total += weight[j];
        of_ink += weighted;
        of_square += weighted * ink[j];
        of_values += weight[j] * values[j];
        of_both += weighted * values[j];
    }
    total = greater_f(total, 1e-9f);
    float mean = of_ink / total;
    float rise = (of_both - mean * of_values) / greater_f(of_square - mean * of_ink, 1e-9f);
    float paper = of_values / total - rise * mean;
    for (count j = 0; j < n; j++)
        model[j] = paper + rise * ink[j];
    *step = rise;
    *contrast = rise / greater_f(greater_f(paper, paper + rise), 0.1f);
}

/* What a camera that clips differs by from the model, and the gain. What is seen between pixels is
   interpolated after they are clipped. */
static void see(count n, const struct ray *of)
{
    for (count j = 0; j < n; j++) {
        count places[3] = {j, j < of->apart ? 0 : j - of->apart,
                           j + of->apart < n ? j + of->apart : n - 1};
        float shown[3], known[3];
        for (int i = 0; i < 3; i++) {
            float value = of->model[places[i]];
            shown[i] = held_f(value, 0, of->highest[places[i]]);
            known[i] = shown[i] == value;
        }
        float share = of->mixed[j];
        of->errors[j] = of->seen[j] - shown[0] - share * ((shown[1] + shown[2]) / 2 - shown[0]);
        of->gain[j] = known[0] + share * ((known[1] + known[2]) / 2 - known[0]);
    }
}

/* Fit a ray, by its weights and from the model if there is one. */
static void fit_ray(count n, const struct ray *of, bool begun, float rows[2][n], double *step,
                    double *contrast)
{
    if (!of->apart || !begun)
        fit_line(n, of->seen, of->weight, of->ink, of->model, step, contrast);
    for (int round = 0; of->apart && round < of->rounds_of_clipped; round++) {
        see(n, of);
        for (count j = 0; j < n; j++) {
            float steady = greater_f(of->gain[j], (float)of->least_gain);
            rows[0][j] = of->model[j] + of->errors[j] / steady;
            rows[1][j] = of->weight[j] * steady * steady;
        }
        fit_line(n, rows[0], rows[1], of->ink, of->model, step, contrast);
    }
    if (of->apart)
        see(n, of);
    for (count j = 0; !of->apart && j < n; j++) {
        of->errors[j] = of->seen[j] - of->model[j];
        of->gain[j] = 1;
    }
}

/* Moments of pairs of variables, of `size` of which the first explains a part of the others: these
   are left. They are those of the upper triangle of a matrix, row by row, before and after. */
static void leave_first(int size, double pairs[PAIRS])
{
    double head[BASIS], share[BASIS];
    for (int a = 0; a < size; a++) {
        head[a] = pairs[a];
        share[a] = pairs[a] / (pairs[0] + 1e-6);
    }
    for (int a = 1, pair = 0; a < size; a++)
        for (int b = a; b < size; b++, pair++)
            pairs[pair] = pairs[pair + size] - head[a] * share[b];
}

/* Add a ray to the normal equations of a target; return its weighted squares of errors. */
static double add_ray(count n, const struct ray *of, const float products[n][PAIRS],
                    const float basis[n][BASIS], double step, const double around[7],
                    float rows[2][n], double normal[UNKNOWNS][UNKNOWNS], double right[UNKNOWNS])
{
    float errors[BASIS] = {0}, squares = 0;
    for (count j = 0; j < n; j++) {
        float weight = of->weight[j] * of->gain[j], error = weight * of->errors[j];
        squares += of->weight[j] * of->errors[j] * of->errors[j];
        rows[0][j] = weight * of->gain[j];
        for (int a = 0; a < BASIS; a++)
            errors[a] += error * basis[j][a];
    }
    double pairs[PAIRS], full[CHANGES][CHANGES], by[UNKNOWNS];
    for (int first = 0; first < PAIRS; first += SOME) { /* sums that stay in registers */
        float sums[SOME] = {0};
        for (count j = 0; j < n; j++)
            for (int pair = 0; pair < SOME; pair++)
                sums[pair] += rows[0][j] * products[j][first + pair];
        for (int pair = 0; pair < SOME; pair++)
            pairs[first + pair] = sums[pair];
    }
    leave_first(BASIS, pairs);
    leave_first(BASIS - 1, pairs);
    for (int a = 0, pair = 0; a < CHANGES; a++)
        for (int b = a; b < CHANGES; b++)
            full[a][b] = full[b][a] = pairs[pair++];
    for (int a = 0; a < UNKNOWNS; a++)
        by[a] = step * (a < 7 ? -around[a] : 1);
    for (int a = 0; a < UNKNOWNS; a++) {
        right[a] += by[a] * errors[2 + CHANGED[a]];
        for (int b = a; b < UNKNOWNS; b++)
            normal[a][b] += by[a] * by[b] * full[CHANGED[a]][CHANGED[b]];
    }
    return squares;
}

/* Weights of all rays, less where a ray has another contrast, and where light disturbs. */
static void weigh(count m, count n, const float along[n], const double contrast[2][m],
                  const float errors[m][n], double outlier, double other_contrast, double quiet,
                  double normal_spread, double least, double scratch[m], double sizes[n],
                  float weight[m][n])
{
    double place = quiet * (double)(m - 1), low;
    count rank = (count)held(place, 0, (double)(m - 1));
    for (count a = 0; a < m; a++) {
        for (count j = 0; j < (n + 1) / 2; j++) /* neighbours err alike */
            sizes[j] = fabsf(errors[a][2 * j]);
        scratch[a] = ranked((n + 1) / 2, sizes, (n + 1) / 4);
    }
    low = ranked(m, scratch, rank);
    double high = rank + 1 < m ? ranked(m, scratch, rank + 1) : low;
    double spread = normal_spread * (low + (place - (double)rank) * (high - low));
    float over = (float)(1 / (outlier * greater(spread, least)));
    for (count a = 0; a < m; a++)
        scratch[a] = contrast[0][a];
    double usual = middle(m, scratch), most = other_contrast * greater(fabs(usual), 1e-9);
    for (count a = 0; a < m; a++) {
        float alike = (float)geman_mcclure((contrast[0][a] - usual) / most);
        for (count j = 0; j < n; j++) {
            float unlike = errors[a][j] * over, share = 1 / (1 + unlike * unlike);
            weight[a][j] = alike * along[j] * share * share;
        }
    }
}

void cctag_rays(rows k, count m, count n, const float values[k][m][n],
                const float highest[k][m][n], const float mixed[k][m][n], const int32_t apart[k],
                const float ink[k][n], const float by_radius[k][n], const float by_shift[k][n],
                const float by_blur[k][n], const float by_sharpening[k][n], const float along[n],
                const double around[m][7], int16_t rounds, double outlier, double other_contrast,
                double quiet, double normal_spread, double least, int16_t rounds_of_clipped,
                double least_gain, float weight[k][m][n], float model[k][m][n],
                float errors[k][m][n], float gain[k][m][n], double step[k][m], double variance[k],
                double normal[k][10][10], double right[k][10], double contrast[2][m],
                double sizes[n], float products[n][36], float basis[n][8], float rows[2][n])
{
    for (count i = 0; i < k; i++) {
        for (count a = 0; a < m; a++)
            for (count j = 0; j < n; j++)
                weight[i][a][j] = along[j];
        for (int round = 0; round <= rounds; round++) {
            if (round)
                weigh(m, n, along, contrast, errors[i], outlier, other_contrast, quiet,
                      normal_spread, least, contrast[1], sizes, weight[i]);
            for (count a = 0; a < m; a++) {
                struct ray of = {values[i][a], ink[i], highest[i][a], mixed[i][a],
                                 within(apart[i], n + 1), least_gain, rounds_of_clipped,
                                 weight[i][a], model[i][a], errors[i][a], gain[i][a]};
                fit_ray(n, &of, round > 0, rows, &step[i][a], &contrast[0][a]);
            }
        }
        for (int a = 0; a < UNKNOWNS; a++) {
            right[i][a] = 0;
            for (int b = 0; b < UNKNOWNS; b++)
                normal[i][a][b] = 0;
        }
        variance[i] = 0;
        if (!rounds)
            continue;
        for (count j = 0; j < n; j++) {
            float radius = along[j], of_radius = by_radius[i][j];
            const float all[BASIS] = {1, ink[i][j], of_radius, of_radius * radius,
                                      of_radius * radius * radius, by_shift[i][j], by_blur[i][j],
                                      by_sharpening[i][j]};
            for (int a = 0, pair = 0; a < BASIS; a++) {
                basis[j][a] = all[a];
                for (int b = a; b < BASIS; b++)
                    products[j][pair++] = all[a] * all[b];
            }
        }
        double total = 0;
        for (count a = 0; a < m; a++) {
            struct ray of = {.weight = weight[i][a], .errors = errors[i][a], .gain = gain[i][a]};
            variance[i] += add_ray(n, &of, products, basis, step[i][a], around[a], rows, normal[i],
                                   right[i]);
            for (count j = 0; j < n; j++)
                total += weight[i][a][j];
        }
        variance[i] /= greater(total, 1e-9);
        mirror(UNKNOWNS, normal[i]);
    }
}
