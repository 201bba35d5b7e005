/* Values of images at places between pixels. */

#ifndef AHF_IMAGES_H
#define AHF_IMAGES_H

#include <math.h>

#include "elementary.h"
#include "kernels.h"

/* Pixels about a place, px, and its shares of them; beyond the border the nearest one counts. */
struct pixels {
    count left, right, upper, lower;
    double across, down;
};

static inline struct pixels pixels_at(count h, count w, double x, double y)
{
    x = lesser(greater(x, 0), (double)(w - 1)), y = lesser(greater(y, 0), (double)(h - 1));
    count left = (int32_t)x, upper = (int32_t)y;
    return (struct pixels){left,  left + (left + 1 < w),     upper, upper + (upper + 1 < h),
                           x - (double)left, y - (double)upper};
}

static inline double between(double upper_left, double upper_right, double lower_left,
                             double lower_right, double across, double down)
{
    double upper = upper_left + across * (upper_right - upper_left);
    double lower = lower_left + across * (lower_right - lower_left);
    return upper + down * (lower - upper);
}

static inline double value_at(count h, count w, const float gray[h][w], double x, double y)
{
    struct pixels at = pixels_at(h, w, x, y);
    return between(gray[at.upper][at.left], gray[at.upper][at.right], gray[at.lower][at.left],
                   gray[at.lower][at.right], at.across, at.down);
}

static inline double byte_at(count h, count w, const uint8_t gray[h][w], double x, double y)
{
    struct pixels at = pixels_at(h, w, x, y);
    return between(gray[at.upper][at.left], gray[at.upper][at.right], gray[at.lower][at.left],
                   gray[at.lower][at.right], at.across, at.down);
}

/* Places of single precision, held within an image: the pixel above and to the left of each, which is
   none of the last row or column, how far beyond that it is, and how far it was outside. */
enum { POINTS = 64 };
typedef struct {
    int32_t left[POINTS], top[POINTS];
    float across[POINTS], down[POINTS], outside[POINTS];
} places;

/* The last pixel but some of a side, as far as floats know whole numbers. */
static inline float last(count side, count but)
{
    count place = side > but ? side - but : 0;
    return (float)(place < 1 << 24 ? place : 1 << 24);
}

static inline void hold(count h, count w, count n, const float column[n], const float row[n],
                        places *at)
{
    float last_column = last(w, 1), last_row = last(h, 1);
    float last_left = last(w, 2), last_top = last(h, 2);
    for (count a = 0; a < n; a++) {
        float right = lesser_f(greater_f(column[a], 0), last_column);
        float low = lesser_f(greater_f(row[a], 0), last_row);
        at->outside[a] = fabsf(right - column[a]) + fabsf(low - row[a]);
        at->left[a] = (int32_t)lesser_f(right, last_left);
        at->top[a] = (int32_t)lesser_f(low, last_top);
        at->across[a] = right - (float)at->left[a];
        at->down[a] = low - (float)at->top[a];
    }
}

static inline float value_of(count h, count w, const float image[h][w], const places *at, count a)
{
    const float *upper = image[at->top[a]], *lower = image[at->top[a] + (h > 1)];
    count left = at->left[a], next = left + (w > 1);
    float over = upper[left] + at->across[a] * (upper[next] - upper[left]);
    float under = lower[left] + at->across[a] * (lower[next] - lower[left]);
    return over + at->down[a] * (under - over);
}

/* The nearest whole number of parts. */
static inline float rounded(float value, float parts)
{
    return (float)(int32_t)(value * parts + (value < 0 ? -0.5f : 0.5f)) / parts;
}

/* The values of an image of whole numbers at n places, which are such numbers themselves. Places are
   those of 32 in a pixel, as in cv2.remap, which samples the same images elsewhere. */
static inline void shorts_of(count h, count w, const int16_t image[h][w], const places *at, count n,
                             float values[n])
{
    int32_t near[4][POINTS];
    for (count a = 0; a < n; a++) {
        count top = at->top[a], low = top + (h > 1), left = at->left[a], right = left + (w > 1);
        near[0][a] = image[top][left], near[1][a] = image[top][right];
        near[2][a] = image[low][left], near[3][a] = image[low][right];
    }
    for (count a = 0; a < n; a++) {
        float across = rounded(at->across[a], 32), down = rounded(at->down[a], 32);
        float over = (float)near[0][a] + across * (float)(near[1][a] - near[0][a]);
        float under = (float)near[2][a] + across * (float)(near[3][a] - near[2][a]);
        values[a] = rounded(over + down * (under - over), 1);
    }
}

/* Points at a radius in n directions, which a frame has made those of an image. */
static inline void place(count h, count w, count n, const float along[3][POINTS],
                         const float centre[3], float radius, places *at)
{
    float column[POINTS], row[POINTS];
    for (count a = 0; a < n; a++) {
        float scale = along[2][a] * radius + centre[2];
        column[a] = (along[0][a] * radius + centre[0]) / scale;
        row[a] = (along[1][a] * radius + centre[1]) / scale;
    }
    hold(h, w, n, column, row, at);
}

/* What a frame makes of the centre, and of up to POINTS directions. */
static inline void project(count n, const double frame[3][3], const double *x, const double *y,
                           float along[3][POINTS], float centre[3])
{
    for (int row = 0; row < 3; row++) {
        centre[row] = (float)frame[row][2];
        for (count a = 0; a < n; a++)
            along[row][a] = (float)(frame[row][0] * x[a] + frame[row][1] * y[a]);
    }
}

#endif
