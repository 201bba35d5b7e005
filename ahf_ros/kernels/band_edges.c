/* What is seen of bands in polar images, as families/ring/likelihood.py compares it: gray values at
   some radii, and the evidence of the steps between a band and the ground beside it. */

#include <math.h>

#include "elementary.h"
#include "kernels.h"

static const float NEVER_SEEN = 1e9f; /* more than any gray value, or radius */

/* Share of ink at a distance from the edge that blur made of it, in deviations. */
static inline double blurred(double distance)
{
    return distance > 6 ? 1 : distance < -6 ? 0 : normal_share(distance);
}

/* Shares of ink that blur leaves or brings at radii, of a bare band and of a marked one: ink of the
   dot, white paper beyond a plate, which is as white ink, and the band. All in dot radii. */
void ink_shares(count k, count r, count g, count m, const double radii[k][r][g],
                const double plate[k][m], const double dot[k], const double inner[k],
                const double outer[k], const double blur[k], float bare[k][r][m],
                float marked[k][r][m])
{
    for (count b = 0; b < k; b++)
        for (count j = 0; j < r; j++) {
            double of_dot = 0, of_band = 0;
            for (count a = 0; a < m; a++) {
                double at = radii[b][j][g == 1 ? 0 : a];
                if (a == 0 || g > 1) {
                    of_dot = blurred((dot[b] - at) / blur[b]);
                    of_band = blurred((outer[b] - at) / blur[b]) -
                              blurred((inner[b] - at) / blur[b]);
                }
                double beyond = plate[b][a] < NEVER_SEEN ? 1 - blurred((plate[b][a] - at) / blur[b])
                                                  : 0;
                bare[b][j][a] = (float)(of_dot + beyond);
                marked[b][j][a] = (float)(of_dot + beyond + of_band);
            }
        }
}

/* How ink and light look in one target, and how steps of ln are spread. */
typedef struct {
    float ink, offset, white, white_ink, glare; /* ink over paper; gray values */
    float flat, of_white, mark, tail, share, noise, plain, any;
} look;

static inline look ink_of(float contrast, bool dark, float white, float offset)
{
    return (look){.ink = dark ? contrast : 1 / contrast, .offset = offset, .white = white,
                  .white_ink = dark ? NEVER_SEEN : white};
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

/* Densities of a step of ln, as paper makes it, as ink does, and as anything; the step of ink, and
   what the errors of both are. */
typedef struct {
    float paper, ink, anything, mark, spread, low, high, known;
} step;

static inline step compared(look of, float beside, float lower, float here, float bare,
                            float marked, float bare_here, float marked_here)
{
    step it;
    float gray_ink = printed(of, beside, marked, marked_here, here);
    float level = raised(of, here), below = raised(of, beside), ink = raised(of, gray_ink);
    float blank = raised(of, printed(of, beside, bare, bare_here, here));
    it.mark = logarithm_f(ink / below);
    float flat = lower >= of.white ? of.of_white : of.flat;
    float of_noise = of.noise / level, of_ground = of.noise / below;
    it.spread = sqrtf(flat * flat + of_noise * of_noise + of_ground * of_ground);
    it.paper = normal_density_f(logarithm_f(level / blank), it.spread);
    it.anything = of.plain * it.paper + (1 - of.plain) * of.any;
    float of_ink = of_ground * (gray_ink / greater_f(beside, 1)) * (below / ink);
    it.known = of_noise * of_noise + of_ink * of_ink;
    it.low = sqrtf(of.mark * of.mark + it.known);
    it.high = sqrtf(of.tail * of.tail + it.known);
    float more = logarithm_f(level / ink);
    more = it.mark < 0 ? -more : more;
    float width = more > 0 ? it.high : it.low;
    it.ink = normal_density_f(more, width) * (2 * width / (it.low + it.high));
    /* Glare makes the step of a mark smaller. */
    float size = fabsf(it.mark), under_glare = 1 / greater_f(size, of.flat);
    under_glare = beside >= of.glare ? under_glare : 0;
    under_glare = more < 0 ? under_glare : 0;
    under_glare = more > -size ? under_glare : 0;
    it.ink = greater_f(it.ink, under_glare);
    return it;
}

/* Log odds of a density, unless light that nothing predicts is there. */
static inline float log_odds(look of, float density, float doubt, float anything)
{
    return logarithm_f(((1 - doubt) * density + doubt * of.any) / anything);
}

/* Log odds of paper and of ink at one edge of one band. No array is another one, so that a compiler
   can take several angles at a time. */
static void paper_and_ink(count m, look of, float doubt, float told_below,
                          const float *restrict beside, const float *restrict inner,
                          const float *restrict outer, const float *restrict here,
                          const float *restrict bare, const float *restrict marked,
                          const float *restrict bare_here, const float *restrict marked_here,
                          const float *restrict told, float *restrict paper, float *restrict ink)
{
    for (count a = 0; a < m; a++) {
        step it = compared(of, beside[a], lesser_f(inner[a], outer[a]), here[a], bare[a], marked[a],
                           bare_here[a], marked_here[a]);
        float weight = told[a];
        weight = here[a] < told_below ? weight : 0;
        paper[a] = weight * log_odds(of, it.paper, doubt, it.anything);
        ink[a] = weight * log_odds(of, it.ink, doubt, it.anything);
    }
}

/* Log odds of paper, of shares of ink and of ink in bands against anything, from the steps of ln
   between the ground beside either edge and the band there: [0] at the inner edge, [1] at the outer
   one. `typical` is what paper and ink give on average if they look as they should, in bands that
   are compared with shares of ink between.

   Where glare makes the ground on both sides white, paper between is white. White paper may be ink
   under glare, but white ink on dark ground is ink. */
void step_evidence(count k, count m, count n, const float ground[k][2][m],
                   const float band[k][2][m], const float bare_ground[k][2][m],
                   const float marked_ground[k][2][m], const float bare_band[k][2][m],
                   const float marked_band[k][2][m], const float counts[k][2][m],
                   const float shares[n], const float contrast[k], const bool dark[k],
                   const float noise[k], const float glare[k], const float lit[k], float offset,
                   float white, float flat, float flat_white, float mark, float tail, float share,
                   float any, float plain, float at_ends, float looks[k][2][n][m],
                   float typical[k][2][2][m])
{
    for (count b = 0; b < k; b++) {
        look of = ink_of(contrast[b], dark[b], white, offset);
        of.glare = glare[b];
        of.flat = flat;
        of.of_white = glare[b] <= white ? flat_white : flat;
        of.mark = mark;
        of.tail = tail;
        of.share = share;
        of.noise = noise[b];
        of.plain = plain;
        of.any = any;
        float told_below = !dark[b] || glare[b] > NEVER_SEEN ? NEVER_SEEN : white, doubt = lit[b];
        float at_edge = doubt * logarithm_f(doubt / (1 - plain));
        float at_end = greater_f(doubt, at_ends);
        for (count side = 0; side < 2; side++) {
            const float *here = band[b][side], *beside = ground[b][side], *told = counts[b][side];
            const float *bare = bare_ground[b][side], *marked = marked_ground[b][side];
            const float *bare_here = bare_band[b][side], *marked_here = marked_band[b][side];
            const float *inner = ground[b][0], *outer = ground[b][1];
            paper_and_ink(m, of, doubt, told_below, beside, inner, outer, here, bare, marked,
                          bare_here, marked_here, told, looks[b][side][0], looks[b][side][n - 1]);
            for (count a = 0; a < m && n == 2; a++)
                typical[b][side][0][a] = typical[b][side][1][a] = 0;
            for (count a = 0; a < m && n > 2; a++) {
                step it = compared(of, beside[a], lesser_f(inner[a], outer[a]), here[a], bare[a],
                                   marked[a], bare_here[a], marked_here[a]);
                float weight = here[a] < told_below ? told[a] : 0, of_share = of.share * it.mark;
                float width = sqrtf(of.mark * of.mark + of_share * of_share + it.known);
                for (count s = 1; s < n - 1; s++) {
                    float on_ground = bare[a] + shares[s] * (marked[a] - bare[a]);
                    float on_band = bare_here[a] + shares[s] * (marked_here[a] - bare_here[a]);
                    float mixed = raised(of, printed(of, beside[a], on_ground, on_band, here[a]));
                    float density =
                        normal_density_f(logarithm_f(raised(of, here[a]) / mixed), width);
                    looks[b][side][s][a] = weight * log_odds(of, density, at_end, it.anything);
                }
                float paper = normal_density_f(0, it.spread);
                float ink = normal_density_f(0, (it.low + it.high) / 2);
                float as_paper = plain * paper + (1 - plain) * any;
                float as_ink = plain * normal_density_f(it.mark, it.spread) + (1 - plain) * any;
                typical[b][side][0][a] =
                    weight * ((1 - doubt) * log_odds(of, paper, doubt, as_paper) + at_edge);
                typical[b][side][1][a] =
                    weight * ((1 - doubt) * log_odds(of, ink, doubt, as_ink) + at_edge);
            }
        }
    }
}

/* Where something covers the ground beside either edge of bands, which is no shadow: marks in
   shadow are darker than those in the light, and nothing that covers a target is. `lit` is the
   ground as paper, and `inked` what ink in the shade would be where each reading is seen. */
void covered_ground(count k, count m, const float ground[k][2][m], const float band[k][2][m],
                    const float lit[k][2][m], const bool marked[k][2][m],
                    const bool visible[k][2][m], const float shade[k], const float contrast[k],
                    const bool dark[k], float offset, float white, float light_edge,
                    float marked_share, bool covered[k][2][m])
{
    for (count b = 0; b < k; b++) {
        look of = ink_of(contrast[b], dark[b], white, offset);
        count every = 0, in_shadow = 0;
        for (count side = 0; side < 2; side++)
            for (count a = 0; a < m; a++) {
                float here = band[b][side][a];
                bool dim = visible[b][side][a] && lit[b][side][a] <= shade[b];
                covered[b][side][a] = dim;
                every += dim;
                in_shadow += dim && marked[b][side][a] && here < printed(of, shade[b], 0, 1, here);
            }
        bool shadow = (float)in_shadow > marked_share * (float)every;
        for (count a = 0; a < m; a++) {
            bool ground_as_ink[2], across = true, dim[2];
            for (count side = 0; side < 2; side++) {
                dim[side] = covered[b][side][a] && !shadow;
                float as_ink = logarithm_f(raised(of, printed(of, shade[b], 0, 1, lit[b][side][a])));
                float of_ground = logarithm_f(raised(of, ground[b][side][a]));
                float of_band = logarithm_f(raised(of, band[b][side][a]));
                ground_as_ink[side] = fabsf(of_ground - as_ink) < light_edge;
                across &= fabsf(of_band - as_ink) < light_edge;
            }
            /* The border of what is as dark as ink looks like the edge of a mark. */
            for (count side = 0; side < 2; side++)
                covered[b][side][a] =
                    dim[side] || (dim[1 - side] && ground_as_ink[1 - side] && across);
        }
    }
}
