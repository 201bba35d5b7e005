/* Robust statistics, and the small systems of equations that they lead to. */

#ifndef AHF_ROBUST_H
#define AHF_ROBUST_H

#include <math.h>

#include "kernels.h"

static inline double squared(double x) { return x * x; }

/* Cauchy's weight, halved where the error is 1. */
static inline double cauchy(double error) { return 1.0 / (1.0 + error * error); }

/* Geman and McClure's weight, of which a quarter is left where the error is 1. */
static inline double geman_mcclure(double error) { return squared(cauchy(error)); }

/* The derivative of an error times its Geman-McClure weight. */
static inline double geman_mcclure_gain(double error)
{
    double square = error * error;
    return (1.0 - 3.0 * square) / ((1.0 + square) * squared(1.0 + square));
}

/* The value of a rank among n, whose order changes. Parts of values follow each other without a
   branch, which no processor could predict. */
static inline double ranked(count n, double values[n], count rank)
{
    for (count low = 0, high = n;;) {
        double pivot = values[low + (high - low) / 2];
        count less = low, same; /* where values end that are less than the pivot, or as it is */
        for (count i = low; i < high; i++) {
            double value = values[i];
            values[i] = values[less];
            values[less] = value;
            less += value < pivot;
        }
        same = less;
        for (count i = less; i < high && rank >= less; i++) {
            double value = values[i];
            values[i] = values[same];
            values[same] = value;
            same += !(pivot < value);
        }
        if (rank >= less && rank < same)
            return pivot;
        low = rank < less ? low : same;
        high = rank < less ? less : high;
    }
}

/* The median of values, whose order changes. */
static inline double middle(count n, double values[n])
{
    double upper = ranked(n, values, n / 2), lower = values[0];
    for (count i = 0; i < n / 2; i++)
        lower = lower > values[i] ? lower : values[i];
    return n % 2 ? upper : (lower + upper) / 2;
}

/* The lower median of selected values, or `empty`. */
static inline double median(count n, const double values[n], const bool selected[n], double empty,
                            double scratch[n])
{
    count some = 0;
    for (count i = 0; i < n; i++) {
        scratch[some] = values[i];
        some += selected[i];
    }
    return some ? ranked(some, scratch, (some - 1) / 2) : empty;
}

/* Solve a x = b by elimination with pivots; b becomes x. */
static inline void solve(count n, count m, double a[n][n], double b[n][m])
{
    for (count c = 0; c < n; c++) {
        count pivot = c;
        for (count i = c + 1; i < n; i++)
            if (fabs(a[i][c]) > fabs(a[pivot][c]))
                pivot = i;
        for (count j = 0; pivot != c && j < n; j++) {
            double swapped = a[c][j];
            a[c][j] = a[pivot][j];
            a[pivot][j] = swapped;
        }
        for (count j = 0; pivot != c && j < m; j++) {
            double swapped = b[c][j];
            b[c][j] = b[pivot][j];
            b[pivot][j] = swapped;
        }
        for (count i = c + 1; i < n; i++) {
            double share = a[i][c] / a[c][c];
            for (count j = c; j < n; j++)
                a[i][j] -= share * a[c][j];
            for (count j = 0; j < m; j++)
                b[i][j] -= share * b[c][j];
        }
    }
    for (count c = n - 1; c >= 0; c--)
        for (count j = 0; j < m; j++) {
            for (count i = c + 1; i < n; i++)
                b[c][j] -= a[c][i] * b[i][j];
            b[c][j] /= a[c][c];
        }
}

/* The lower triangle of normal equations is that above the diagonal. */
static inline void mirror(count n, double normal[n][n])
{
    for (count a = 0; a < n; a++)
        for (count b = 0; b < a; b++)
            normal[a][b] = normal[b][a];
}

static inline double dot(count n, const double a[n], const double b[n])
{
    double sum = 0;
    for (count i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Set the products of each pair of columns of a basis; those of a row follow each other. */
static inline void set_products(count m, count n, const double basis[m][n],
                                double products[m][n][n])
{
    double *product = products[0][0];
    for (count j = 0; j < m; j++)
        for (count a = 0; a < n; a++)
            for (count b = a; b < n; b++)
                *product++ = basis[j][a] * basis[j][b];
}

/* Solve weighted least squares of q unknowns, whose inverse variances before are `prior`.

   Their derivatives are the n columns of a basis, whose products are known, and one of its own if
   q is n + 1. */
static inline void least_squares(count m, count n, count q, const double basis[m][n],
                                 const double products[m][n][n], const double own[m],
                                 const double weights[m], const double values[m],
                                 const double prior[q], double normal[q][q], double unknowns[q])
{
    count pairs = n * (n + 1) / 2;
    const double *product = products[0][0];
    double sums[pairs], mixed[n], right[n], square = 0, last = 0, solved[q][q];
    for (count pair = 0; pair < pairs; pair++)
        sums[pair] = 0;
    for (count a = 0; a < n; a++)
        mixed[a] = right[a] = 0;
    for (count j = 0; j < m; j++) {
        double weight = weights[j], value = weight * values[j];
        if (weight == 0) {
            product += pairs;
            continue;
        }
        for (count pair = 0; pair < pairs; pair++)
            sums[pair] += weight * *product++;
        for (count a = 0; a < n; a++)
            right[a] += value * basis[j][a];
        if (q > n) {
            weight *= own[j];
            square += weight * own[j];
            last += value * own[j];
            for (count a = 0; a < n; a++)
                mixed[a] += weight * basis[j][a];
        }
    }
    for (count a = 0, pair = 0; a < q; a++)
        for (count b = a; b < q; b++) {
            double sum = b < n ? sums[pair++] : a < n ? mixed[a] : square;
            normal[a][b] = normal[b][a] = a == b ? sum + prior[a] : sum;
        }
    for (count a = 0; a < q; a++) {
        unknowns[a] = a < n ? right[a] : last;
        for (count b = 0; b < q; b++)
            solved[a][b] = normal[a][b];
    }
    solve(q, 1, solved, (double(*)[1])unknowns);
}

/* A linear model of values, by reweighting after Geman and McClure: a residual of `scale` leaves a
   quarter of a weight. */
static inline void linear_fit(count m, count n, const double values[m], const double weights[m],
                              const double basis[m][n], const double products[m][n][n],
                              const double prior[n], double scale, int16_t rounds,
                              double unknowns[n], double residuals[m], double robust[m],
                              double normal[n][n])
{
    for (int round = 0; round < rounds; round++) {
        for (count j = 0; j < m; j++) {
            robust[j] = weights[j];
            if (round)
                robust[j] *= geman_mcclure(residuals[j] / scale);
        }
        least_squares(m, n, n, basis, products, NULL, robust, values, prior, normal, unknowns);
        for (count j = 0; j < m; j++)
            residuals[j] = values[j] - dot(n, basis[j], unknowns);
    }
}

#endif
