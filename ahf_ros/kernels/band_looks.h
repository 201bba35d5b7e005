/* How paper, ink and what lies between look in a target. */

#ifndef AHF_BAND_LOOKS_H
#define AHF_BAND_LOOKS_H

#include <math.h>

#include "elementary.h"
#include "kernels.h"

static const float NEVER_SEEN = 1e9f; /* more than any gray value, or radius */

/* Numbers that decide, in the order of likelihood.py. */
typedef struct {
    double innermost, offset, white; /* circle; gray values */
    double beside, soft, least_beside, most_beside, across[2]; /* where readings are */
    double light_edge, least_doubt, most_doubt, marked_share;
    double flat, flat_white, mark, tail, share, any, plain, at_ends; /* of steps of ln */
    double paper_level, ink_level, unlikely; /* of levels */
} numbers;

/* How a target looks: circle, px, gray values; what of it is drawn. */
typedef struct {
    double outermost, size, blur, polarity, contrast, noise, shade, glare, brightest;
} target;

/* Ink over paper, how white ink is, and how steps of ln are spread, in one target. */
typedef struct {
    float ink, offset, white, white_ink, glare, brightest, told_below;
    float flat, of_white, mark, tail, share, noise, plain, any, doubt, at_ends;
} look;

static inline look look_of(const numbers *of, const target *it, float doubt)
{
    bool dark = it->polarity > 0;
    float contrast = (float)it->contrast, white = (float)of->white;
    /* White paper may be ink under glare, but white ink on dark ground is ink. */
    return (look){.ink = dark ? contrast : 1 / contrast, .offset = (float)of->offset,
                  .white = white, .white_ink = dark ? NEVER_SEEN : white,
                  .glare = (float)it->glare, .brightest = (float)it->brightest,
                  .told_below = !dark || it->glare > NEVER_SEEN ? NEVER_SEEN : white,
                  .flat = (float)of->flat,
                  .of_white = (float)(it->glare <= of->white ? of->flat_white : of->flat),
                  .mark = (float)of->mark, .tail = (float)of->tail, .share = (float)of->share,
                  .noise = (float)it->noise, .plain = (float)of->plain, .any = (float)of->any,
                  .doubt = doubt, .at_ends = greater_f(doubt, (float)of->at_ends)};
}

/* Whether ground has another gray value than light leaves it: darker, or on dark ground brighter. */
static inline bool is_covered(const target *it, float ground)
{
    return it->polarity > 0 ? ground <= (float)it->shade : ground >= (float)it->shade;
}

/* Share of ink at a distance from the edge that blur made of it, in deviations. */
static inline double blurred(double distance)
{
    return distance > 6 ? 1 : distance < -6 ? 0 : normal_share(distance);
}

/* Gray value of paper of which a share is ink, where ground of which another share is ink is seen.
   Ink that would be brighter than white is as bright as what is `seen` if that is white. */
static inline float printed(look of, float ground, float of_ground, float share, float seen)
{
    float paper = ground / (1 + of_ground * (of.ink - 1)), ink = paper * of.ink;
    float bounded = lesser_f(ink, seen);
    ink = seen >= of.white_ink ? bounded : ink;
    return paper + share * (ink - paper);
}

static inline float raised(look of, float gray) { return greater_f(gray, 0) + of.offset; }

/* Density of ln of what is seen of a share of bright ink, whose ground is black: the error of its gray
   value leaves the light open, up to the brightest. */
static inline float in_the_dark(look of, float share, float ink, float seen, float ground_error)
{
    float most = share * of.brightest, mean = lesser_f(ink, most), usual = of.mark * mean;
    float of_light = lesser_f(share * ground_error * of.ink, most);
    float error = sqrtf(of_light * of_light + of.noise * of.noise + usual * usual);
    return raised(of, seen) * normal_density_f(seen - mean, error);
}

/* Log odds of a density, unless light that nothing predicts is there. */
static inline float log_odds(look of, float density, float doubt, float anything)
{
    return logarithm_f(((1 - doubt) * density + doubt * of.any) / anything);
}

#endif
