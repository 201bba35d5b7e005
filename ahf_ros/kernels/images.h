/* Values of images at places between pixels. */

#ifndef AHF_IMAGES_H
#define AHF_IMAGES_H

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

#endif
