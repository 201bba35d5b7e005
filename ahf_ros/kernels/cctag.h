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

/* e^(-x^2 / 2), and 0 where it is less than 1e-17: processors take a hundred times as long for
   products below 1e-38. */
static inline float bell_f(float x)
{
    float square = x * x;
    return square < 78.0f ? exponential_f(-0.5f * square) : 0.0f;
}

/* Share of a normal distribution below x deviations, as `normal_share`, for which `bell_f` is
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

enum { MOST_EDGES = 3, OF_EDGE = 5 };

/* An edge of light: direction, rad, offset, curvature, height and ln of width, in usual widths. */
struct edge {
    float cosine, sine, offset, half, narrow, height, more;
};

static inline struct edge edge_of(const double edge[OF_EDGE], double width)
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
static inline void add_steps(count q, const struct edge *by, float height, const float x[q],
                             const float y[q], float sum[q])
{
    float gain = height / by->height;
    for (count i = 0; i < q; i++) {
        float across = by->cosine * x[i] + by->sine * y[i] - by->offset;
        float along = by->cosine * y[i] - by->sine * x[i];
        float away = (across - by->half * (across * across + along * along)) * by->narrow;
        float share = normal_share_f(away, bell_f(away));
        sum[i] += gain * logarithm_f(1 + by->more * share);
    }
}

struct light {
    float by_x, by_y, heights[MOST_EDGES];
    struct edge edges[MOST_EDGES];
};

static inline struct light light_of(const double heights[2 + MOST_EDGES],
                                    const double edges[MOST_EDGES][OF_EDGE], double width)
{
    struct light light = {.by_x = (float)heights[0], .by_y = (float)heights[1]};
    for (int e = 0; e < MOST_EDGES; e++) {
        light.heights[e] = (float)heights[2 + e];
        light.edges[e] = edge_of(edges[e], width);
    }
    return light;
}

/* ln of light along a ray, and what blur adds where ink changes as well, by its slope, to the second
   order: `blur` is the variance, in steps of the radius and in radii. */
static inline void light_along(count n, const struct light *light, const float x[n],
                               const float y[n], double blur, const float slope[n],
                               float plain[n], float mixed[n])
{
    for (count j = 0; j < n; j++)
        plain[j] = light->by_x * x[j] + light->by_y * y[j];
    for (int e = 0; e < MOST_EDGES; e++)
        if (light->heights[e] != 0)
            add_steps(n, &light->edges[e], light->heights[e], x, y, plain);
    float twice = (float)(blur / 2), once = (float)blur;
    for (count j = 1; j < n - 1; j++)
        mixed[j] = (plain[j + 1] - plain[j - 1]) * twice * slope[j];
    mixed[0] = n > 1 ? (plain[1] - plain[0]) * once * slope[0] : 0;
    mixed[n - 1] = n > 1 ? (plain[n - 1] - plain[n - 2]) * once * slope[n - 1] : 0;
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
