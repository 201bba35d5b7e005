/* Robust statistics of many rows. */

#include "robust.h"

/* The lower medians of the selected values of each row, `empty` where nothing is selected. */
void selected_medians(count k, count m, const double values[k][m], const bool selected[k][m],
                      double empty, double medians[k], double scratch[m])
{
    for (count i = 0; i < k; i++)
        medians[i] = median(m, values[i], selected[i], empty, scratch);
}

/* Linear models of values of each row. */
void linear_fits(rows k, count m, count n, const double values[k][m], const double weights[k][m],
                 const double basis[m][n], const double prior[n], double scale, int16_t rounds,
                 double unknowns[k][n], double residuals[k][m], double robust[m],
                 double normal[n][n], double products[m][n][n])
{
    set_products(m, n, basis, products);
    for (count i = 0; i < k; i++)
        linear_fit(m, n, values[i], weights[i], basis, products, prior, scale, rounds,
                   unknowns[i], residuals[i], robust, normal);
}
