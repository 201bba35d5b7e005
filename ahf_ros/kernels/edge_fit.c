/* Prints fitted to their edges: weights of these, light across them, and robust least squares. */

#include "elementary.h"
#include "robust.h"

/* How much edges look like the usual one of their target: by the ratio of their levels, and by how
   much they are steps. */
void edge_weights(rows k, count m, const double dark[k][m], const double bright[k][m],
                  const double residual[k][m], const bool visible[k][m], double log_offset,
                  double normal, double minimum_contrast, double ratio_doubt,
                  double minimum_ratio_error, double residual_doubt, double minimum_residual,
                  double minimum_bright, bool seen[k][m], double weights[k][m],
                  double contrast[k], double scratch[2][m])
{
    double *values = scratch[0], *sorted = scratch[1];
    for (count i = 0; i < k; i++) {
        for (count j = 0; j < m; j++)
            values[j] = logarithm((greater(bright[i][j], 0) + log_offset) /
                                  (greater(dark[i][j], 0) + log_offset));
        double usual = median(m, values, visible[i], 1.0, sorted);
        for (count j = 0; j < m; j++)
            seen[i][j] =
                visible[i][j] && values[j] > minimum_contrast * usual && values[j] > 0;
        for (count j = 0; j < m; j++)
            values[j] = greater(dark[i][j], 0) / greater(bright[i][j], minimum_bright);
        contrast[i] = median(m, values, seen[i], 1.0, sorted);
        for (count j = 0; j < m; j++)
            values[j] = fabs(values[j] - contrast[i]);
        double error = normal * median(m, values, seen[i], 1.0, sorted);
        error = ratio_doubt * greater(error, minimum_ratio_error);
        usual = greater(median(m, residual[i], seen[i], 1.0, sorted), minimum_residual);
        for (count j = 0; j < m; j++) {
            double excess = greater(residual[i][j] / usual - 1, 0);
            weights[i][j] =
                seen[i][j] ? cauchy(values[j] / error) * cauchy(excess / residual_doubt) : 0;
        }
    }
}

/* Slopes of the light, 1/px, smoothed along lines of n points; their mean towards the bright side
   is not the light's. `totals` are the weights that each is made from. */
void light_slopes(rows k, count l, count n, const double slopes[k][l][n],
                  const int16_t polarity[k][l][n], const double weights[k][l][n],
                  const float window[n][n], const double prior[k], double sharpened,
                  double minimum_usual, double outlier, int16_t rounds, double no_weight,
                  double errors[k][l][n], double smooth[k][l][n], double used[k][l][n],
                  double totals[k][l][n], float sums[2][n], bool seen[n], double scratch[2][n],
                  int32_t spans[n][2])
{
    for (count a = 0; a < n; a++) {
        count first = 0, end = n;
        while (first < n && !window[a][first])
            first++;
        while (end > first && !window[a][end - 1])
            end--;
        spans[a][0] = (int32_t)first, spans[a][1] = (int32_t)end;
    }
    float *weight_sums = sums[0], *slope_sums = sums[1];
    double *sizes = scratch[0], *sorted = scratch[1];
    for (count i = 0; i < k; i++) {
        double total = 0, common = 0;
        for (count line = 0; line < l; line++)
            for (count j = 0; j < n; j++) {
                total += weights[i][line][j];
                common += weights[i][line][j] * polarity[i][line][j] * slopes[i][line][j];
            }
        common /= greater(total, no_weight);
        /* Where edges were sharpened, none of their slopes is the light's. */
        double belief = prior[i] * squared(1 + squared(common / sharpened));
        for (count line = 0; line < l; line++) {
            double *error = errors[i][line], *weight = used[i][line];
            for (count j = 0; j < n; j++) {
                error[j] = slopes[i][line][j] - polarity[i][line][j] * common;
                weight[j] = weights[i][line][j];
                seen[j] = weight[j] > 0;
                smooth[i][line][j] = error[j];
            }
            double middle = median(n, error, seen, 1.0, sorted);
            for (count j = 0; j < n; j++)
                sizes[j] = fabs(error[j] - middle);
            double usual = greater(median(n, sizes, seen, 1.0, sorted), minimum_usual);
            for (int round = 0; round < rounds; round++) {
                for (count j = 0; j < n; j++) {
                    if (round)
                        weight[j] = weights[i][line][j] * cauchy(error[j] / (outlier * usual));
                    weight_sums[j] = slope_sums[j] = 0;
                }
                for (count a = 0; a < n; a++) {
                    double own = slopes[i][line][a] - polarity[i][line][a] * common;
                    float one = (float)weight[a], other = (float)(weight[a] * own);
                    for (count b = spans[a][0]; one && b < spans[a][1]; b++) {
                        weight_sums[b] += one * window[a][b];
                        slope_sums[b] += other * window[a][b];
                    }
                }
                for (count j = 0; j < n; j++) {
                    double own = slopes[i][line][j] - polarity[i][line][j] * common;
                    totals[i][line][j] = weight_sums[j] + belief;
                    smooth[i][line][j] = slope_sums[j] / totals[i][line][j];
                    error[j] = own - smooth[i][line][j];
                }
            }
        }
    }
}

/* Unknowns that bring outlines onto edges, by least squares reweighted after Geman and McClure. The
   last one may be the growth of ink, px. Light moves edges where `uneven`, px, is not 0. */
void outline_fits(rows k, count m, count n, count q, const double offset[k][m],
                  const double sensitivity[k][m], const double slope[k][m],
                  const double dark[k][m], const double bright[k][m], const double scale[k][m],
                  const int16_t polarity[k][m], const bool seen[k][m], const double own[k][m],
                  const double basis[m][n], const double prior[q], double noise, double uneven,
                  double minimum_step, double normal, double outlier, double minimum,
                  bool in_px, int16_t rounds, double unknowns[k][q], double equations[k][q][q],
                  double errors[k][m], double relative[k][m], double weights[k][m],
                  double robust[k][m], double products[m][n][n], double scratch[6][m])
{
    double *displacement = scratch[0], *of_noise = scratch[1], *deviation = scratch[2],
           *sizes = scratch[3], *sorted = scratch[4], *grown = scratch[5];
    bool lit = uneven > 0;
    set_products(m, n, basis, products);
    for (count i = 0; i < k; i++) {
        for (count j = 0; j < m; j++) {
            double px = scale[i][j];
            displacement[j] = (offset[i][j] - sensitivity[i][j] * slope[i][j]) / px;
            of_noise[j] = noise / greater(bright[i][j] - dark[i][j], minimum_step) / px;
            /* Noise moves edges in shadow, light moves all of them. */
            deviation[j] =
                lit ? sqrt(squared(of_noise[j]) + squared(uneven / px)) : of_noise[j];
            robust[i][j] = own[i][j];
            grown[j] = polarity[i][j] / px;
        }
        double usual_noise = lit ? median(m, of_noise, seen[i], 1.0, sorted) : 0;
        for (int round = 0; round < rounds; round++) {
            for (count j = 0; j < m; j++)
                weights[i][j] = robust[i][j] / squared(deviation[j]);
            least_squares(m, n, q, basis, products, grown, weights[i], displacement, prior,
                          equations[i], unknowns[i]);
            for (count j = 0; j < m; j++) {
                bool used = seen[i][j] || own[i][j] > 0;
                errors[i][j] = used ? displacement[j] - dot(n, basis[j], unknowns[i]) : 0;
                if (used && q > n)
                    errors[i][j] -= grown[j] * unknowns[i][n];
                sizes[j] = fabs(errors[i][j]);
            }
            if (lit) {
                double usual = normal * median(m, sizes, seen[i], 1.0, sorted);
                double light = greater(squared(usual) - squared(usual_noise), 0);
                for (count j = 0; j < m; j++)
                    deviation[j] = sqrt(squared(of_noise[j]) + light);
            }
            for (count j = 0; j < m; j++)
                sizes[j] = in_px ? sizes[j] * scale[i][j] : sizes[j] / deviation[j];
            double limit = normal * median(m, sizes, seen[i], 1.0, sorted);
            limit = outlier * greater(limit, minimum);
            for (count j = 0; j < m; j++) {
                relative[i][j] = sizes[j] / limit;
                robust[i][j] = own[i][j] * geman_mcclure(relative[i][j]);
            }
        }
        for (count j = 0; j < m; j++) {
            weights[i][j] = own[i][j] / squared(deviation[j]);
            robust[i][j] /= squared(deviation[j]);
        }
    }
}
