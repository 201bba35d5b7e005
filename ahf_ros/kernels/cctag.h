/* What the kernels of CCTags share. */

#ifndef AHF_CCTAG_H
#define AHF_CCTAG_H

#include <math.h>

#include "elementary.h"
#include "kernels.h"

static inline float held_f(float x, float low, float high)
{
    return lesser_f(greater_f(x, low), high);
}

static inline double held(double x, double low, double high)
{
    return lesser(greater(x, low), high);
}

/* Share of a normal distribution below x deviations, as `normal_share`, for which e^(-x^2 / 2) is
   known. */
static inline float normal_share_f(float x, float power)
{
    float place = 1.0f / (1.0f + 0.23164190f * fabsf(x)), sum = 1.061405429f;
    sum = sum * place - 1.453152027f;
    sum = sum * place + 1.421413741f;
    sum = sum * place - 0.284496736f;
    sum = sum * place + 0.254829592f;
    float tail = 0.5f * sum * place * power;
    return x > 0 ? 1.0f - tail : tail;
}

/* Add the products of a row's values to the upper triangle of normal equations. */
static inline void add_products(count n, double normal[n][n], double right[n],
                                const double row[n], double weight, double value)
{
    for (count a = 0; a < n; a++) {
        double weighted = weight * row[a];
        right[a] += weighted * value;
        for (count b = a; b < n; b++)
            normal[a][b] += weighted * row[b];
    }
}

static inline void mirror(count n, double normal[n][n])
{
    for (count a = 0; a < n; a++)
        for (count b = 0; b < a; b++)
            normal[a][b] = normal[b][a];
}

/* The inverse of a 3 x 3 matrix. */
static inline void inverted(const double a[3][3], double b[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int k = (j + 1) % 3, l = (j + 2) % 3, m = (i + 1) % 3, n = (i + 2) % 3;
            b[i][j] = a[k][m] * a[l][n] - a[k][n] * a[l][m];
        }
    double determinant = a[0][0] * b[0][0] + a[0][1] * b[1][0] + a[0][2] * b[2][0];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            b[i][j] /= determinant;
}

/* A frame after changes by those of `displacement_basis` in vision/frame.py. */
static inline void move_frame(double frame[3][3], const double change[7])
{
    const double by[3][3] = {
        {1 + change[2] + change[3], change[4], change[0]},
        {change[4], 1 + change[2] - change[3], change[1]},
        {change[5], change[6], 1},
    };
    double moved[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            moved[i][j] =
                frame[i][0] * by[0][j] + frame[i][1] * by[1][j] + frame[i][2] * by[2][j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            frame[i][j] = moved[i][j] / moved[2][2];
}

#endif
