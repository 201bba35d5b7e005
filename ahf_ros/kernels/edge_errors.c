/* What errors of edges do to centres. */

#include "elementary.h"
#include "robust.h"

static inline float float_dot(count n, const float a[n], const float b[n])
{
    float sums[8] = {0}, sum = 0; /* several at a time */
    count i = 0;
    for (; i + 8 <= n; i += 8)
        for (int part = 0; part < 8; part++)
            sums[part] += a[i + part] * b[i + part];
    for (; i < n; i++)
        sum += a[i] * b[i];
    for (int part = 0; part < 8; part++)
        sum += sums[part];
    return sum;
}

/* What the error of each edge, and of the light's slope there, does to the centre: not its weight
   times the error, but the derivative of that. */
void edge_parts(rows k, count m, count n, count q, const double basis[m][n],
                const int16_t polarity[k][m], const double scale[k][m],
                const double sensitivity[k][m], const double equations[k][q][q],
                const double own[k][m], const double relative[k][m], const double weights[k][m],
                const double robust[k][m], const double errors[k][m],
                const double light_errors[k][m], const double light_weights[k][m],
                const double light_totals[k][m], const float window[m][m], double minimum_gain,
                double no_weight, double parts[k][2][m], double used[k][m], double inverse[q][2],
                float slopes[m])
{
    for (count i = 0; i < k; i++) {
        double gain = 0, total = 0;
        for (count j = 0; j < m; j++) {
            gain += weights[i][j] * geman_mcclure_gain(relative[i][j]);
            total += robust[i][j];
            used[i][j] = own[i][j] * geman_mcclure(relative[i][j]);
        }
        gain = greater(gain / greater(total, no_weight), minimum_gain);
        double solved[q][q];
        for (count a = 0; a < q; a++) {
            for (count b = 0; b < q; b++)
                solved[a][b] = equations[i][a][b];
            for (count b = 0; b < 2; b++)
                inverse[a][b] = a == b;
        }
        solve(q, 2, solved, inverse);
        for (int axis = 0; axis < 2; axis++) {
            double *part = parts[i][axis];
            for (count j = 0; j < m; j++) {
                double influence = 0;
                for (count c = 0; c < q; c++)
                    influence += inverse[c][axis] *
                                 (c < n ? basis[j][c] : polarity[i][j] / scale[i][j]);
                influence *= robust[i][j] / gain;
                part[j] = influence * errors[i][j];
                slopes[j] = (float)(influence * sensitivity[i][j] / scale[i][j] /
                                    light_totals[i][j]);
            }
            /* Errors of the light's slope move edges, too. */
            for (count j = 0; j < m; j++) {
                double error = light_weights[i][j] * light_errors[i][j];
                if (error != 0)
                    part[j] -= error * float_dot(m, window[j], slopes);
            }
        }
    }
}

/* By how much variance grows as neighbours have errors in common: Newey & West, 1987. */
void errors_in_common(count k, count m, const double errors[k][m], const double outline[m],
                      int16_t disturbed, double no_error, double growth[k])
{
    for (count i = 0; i < k; i++) {
        double total = greater(dot(m, errors[i], errors[i]), no_error);
        growth[i] = 1;
        for (count steps = 1; steps <= disturbed; steps++) {
            double products = 0;
            for (count j = steps; j < m; j++)
                if (outline[j] == outline[j - steps])
                    products += errors[i][j] * errors[i][j - steps];
            double share = 1 - (double)steps / (double)(disturbed + 1);
            growth[i] += 2 * share * products / total;
        }
        growth[i] = greater(growth[i], 1);
    }
}

/* Covariances of centres, from what errors of edges do; those of neighbours that share pixels are
   alike. */
void edge_covariances(count k, count m, const double parts[k][2][m], const double weights[k][m],
                      const double spacing[k][m], double unknowns, const double common[k],
                      double correlation, double sharing, double no_weight,
                      double covariance[k][2][2])
{
    for (count i = 0; i < k; i++) {
        double sum = 0, squares = 0, shared = 0, xx = 0, xy = 0, yy = 0;
        for (count j = 0; j < m; j++) {
            /* Neighbours that share pixels have errors that are alike. */
            double distance = greater(spacing[i][j] / correlation, 1 / sharing), alike = 1;
            for (int steps = 1; steps * distance < 1; steps++)
                alike += 2 * (1 - steps * distance);
            double weight = weights[i][j], x = parts[i][0][j], y = parts[i][1][j];
            sum += weight;
            squares += weight * weight;
            shared += weight * weight * alike;
            xx += x * x * alike;
            xy += x * y * alike;
            yy += y * y * alike;
        }
        double number = squared(sum) / greater(shared, no_weight);
        shared = greater(shared / greater(squares, no_weight), 1);
        double free = number / greater(number - unknowns, 1) * greater(common[i] / shared, 1);
        covariance[i][0][0] = free * xx;
        covariance[i][0][1] = covariance[i][1][0] = free * xy;
        covariance[i][1][1] = free * yy;
    }
}
