/* Robust statistics of many rows. */

#include "robust.h"

/* The lower medians of the selected values of each row, `empty` where nothing is selected. */
void selected_medians(count k, count m, const double values[k][m], const bool selected[k][m],
                      double empty, double medians[k], double scratch[m])
{
    for (count i = 0; i < k; i++)
        medians[i] = median(m, values[i], selected[i], empty, scratch);
}

/* Linear models of values, by reweighting after Geman and McClure. */
void linear_fits(count k, count m, count n, const double values[k][m], const double weights[k][m],
                 const double basis[m][n], const double prior[n], double scale, int16_t rounds,
                 double unknowns[k][n], double residuals[k][m], double robust[m],
                 double normal[n][n], double products[m][n][n])
{
    set_products(m, n, basis, products);
    for (count i = 0; i < k; i++)
        for (int round = 0; round < rounds; round++) {
            for (count j = 0; j < m; j++) {
                robust[j] = weights[i][j];
                if (round)
                    robust[j] *= geman_mcclure(residuals[i][j] / scale);
            }
            least_squares(m, n, n, basis, products, NULL, robust, values[i], prior, normal,
                          unknowns[i]);
            for (count j = 0; j < m; j++)
                residuals[i][j] = values[i][j] - dot(n, basis[j], unknowns[i]);
        }
}
