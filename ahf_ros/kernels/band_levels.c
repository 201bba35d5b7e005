/* What levels of gap, band and margin say of bands under predicted light, as
   families/ring/likelihood.py compares them. All radii are in dot radii. */

#include <string.h>

#include "band_looks.h"
#include "robust.h"

/* Of readings: ln of the level and of light, and noise of the former; deviations of ln from paper
   and from shares of ink; what counts; and density of anything. */
enum { LEVEL, LIGHT, NOISE, WIDTH, MIXED_WIDTH, COUNTS, ANYTHING, READ };

/* Raise the densities of a share of ink to those of bright ink on black ground. */
static void share_in_the_dark(count m, look of, float share, const float *restrict gray,
                              const float *restrict light, const float *restrict spread,
                              float *restrict density)
{
    for (count a = 0; a < m && of.brightest > 0; a++) {
        float known = spread[a] < NEVER_SEEN ? spread[a] : 1;
        float ink = printed(of, light[a], 0, share, gray[a]), error = known * raised(of, light[a]);
        density[a] = greater_f(density[a], in_the_dark(of, share, ink, gray[a], error));
    }
}

/* Compare the levels of one circle, of which blur makes a share ink, with paper and ink. No array is
   another one. */
static void compare(count m, look of, const numbers *by, float share, const float *restrict gray,
                    const float *restrict light, const float *restrict spread,
                    float *restrict level, float *restrict of_light, float *restrict noise,
                    float *restrict width, float *restrict mixed_width, float *restrict anything,
                    float *restrict paper, float *restrict ink)
{
    float paper_level = (float)by->paper_level, ink_level = (float)by->ink_level;
    float of_share = (float)by->share;
    for (count a = 0; a < m; a++) {
        float unknown = spread[a], known = unknown < NEVER_SEEN ? unknown : 1;
        float here = raised(of, gray[a]), below = raised(of, light[a]);
        float gray_ink = printed(of, light[a], 0, share, gray[a]), on_ink = raised(of, gray_ink);
        float gain = gray_ink / greater_f(light[a], 1) * (below / on_ink);
        float step = logarithm_f(on_ink / below), away = logarithm_f(here / below);
        float squares = here > 0 ? of.noise / here : 0;
        noise[a] = squares;
        squares *= squares;
        float error = known * gain, mixed = of_share * step;
        float ink_width = ink_level * ink_level + squares + error * error;
        level[a] = logarithm_f(here);
        of_light[a] = logarithm_f(below);
        width[a] = sqrtf(paper_level * paper_level + squares + known * known);
        mixed_width[a] = sqrtf(ink_width + mixed * mixed);
        paper[a] = normal_density_f(away, width[a]);
        ink[a] = normal_density_f(away - step, sqrtf(ink_width));
        anything[a] = of.plain * paper[a] + (1 - of.plain) * of.any;
    }
    share_in_the_dark(m, of, share, gray, light, spread, ink);
}

/* The density of a share of ink between. */
static void compare_mixed(count m, look of, float share, const float *restrict gray,
                          const float *restrict light, const float *restrict spread,
                          const float *restrict width, float *restrict density)
{
    for (count a = 0; a < m; a++) {
        float mixed = raised(of, printed(of, light[a], 0, share, gray[a]));
        density[a] = normal_density_f(logarithm_f(raised(of, gray[a]) / mixed), width[a]);
    }
    share_in_the_dark(m, of, share, gray, light, spread, density);
}

/* The log odds of readings, unless light that nothing predicts is there. */
static void odds_of(count m, look of, float weight, const float *restrict density,
                    const float *restrict doubt, const float *restrict anything,
                    const float *restrict counts, float *restrict odds)
{
    for (count a = 0; a < m; a++)
        odds[a] = counts[a] * weight * log_odds(of, density[a], doubt[a], anything[a]);
}

/* Probability that light which looks like ink between two readings of the ground, those of the gap
   and the first ones beyond, is dark ground: it comes from what lies behind a plate, if the ground is
   evenly lit. */
static float behind_a_plate(count d, count m, const bool near[d], const numbers *by,
                            float read[d][READ][m], double scratch[d * m])
{
    count some = 0, uneven = 0;
    for (count j = 0; j < d; j++)
        for (count a = 0; a < m && near[j]; a++)
            scratch[some++] = read[j][LEVEL][a];
    double usual = some ? middle(some, scratch) : 0;
    for (count j = 0; j < d; j++)
        for (count a = 0; a < m && near[j]; a++) {
            double apart = read[j][LEVEL][a] - usual, noise = read[j][NOISE][a];
            uneven += apart * apart > by->light_edge * by->light_edge + 4 * noise * noise;
        }
    double share = greater((double)uneven / (double)(some ? some : 1), by->least_doubt);
    return (float)(by->least_doubt / lesser(share, by->most_doubt));
}

/* Log odds of paper, of shares of ink and of ink in the inner half of bands, [0], and in the outer
   one, from gray values on d circles and those that paper has there, with the deviation of their
   ln; of dots as ink over light on paper; how likely light is that nothing predicts; and where
   something covers the ground. */
void level_evidence(rows k, count d, count m, count n, const float levels[k][d][m],
                    const float light[k][d][m], const float spread[k][d][m], const double radii[d],
                    const double band[2], const double edges[k][2], const double reach[k][m],
                    const double looks_of[k][9], const float weight[k], const float shares[n],
                    const double deciding[24], float looks[k][2][n][m], float dot[k], float lit[k],
                    bool covered[k][2][m], float read[d][7][m], float densities[d][n][m],
                    float rows[2][m], float odds[n][m], double scratch[d][m], bool places[6][d])
{
    float *of_gap = rows[0], *doubt = rows[1];
    bool *in_dot = places[0], *near = places[5];
    bool *ground[2] = {places[1], places[2]}, *in_band[2] = {places[3], places[4]};
    count beyond = d - 1;
    double halfway = (band[0] + band[1]) / 2;
    for (count j = d - 1; j >= 0; j--) {
        bool inside = radii[j] > band[0] && radii[j] < band[1];
        in_dot[j] = radii[j] < 1;
        for (int half = 0; half < 2; half++) {
            bool here = half ? radii[j] > halfway : radii[j] > 1 && radii[j] < halfway;
            ground[half][j] = here && !inside;
            in_band[half][j] = here && inside;
        }
        beyond = ground[1][j] ? j : beyond;
        near[j] = ground[0][j];
    }
    count gaps = 0;
    for (count j = 0; j < d; j++)
        gaps += ground[0][j];
    near[beyond] = true;
    numbers by;
    target it;
    memcpy(&by, deciding, sizeof by);
    for (count b = 0; b < k; b++) {
        memcpy(&it, looks_of[b], sizeof it);
        look of = look_of(&by, &it, 0);
        double blur = it.blur / it.size;
        for (count j = 0; j < d; j++) {
            float(*at)[m] = read[j];
            const float *gray = levels[b][j], *paper = light[b][j];
            float share = (float)(blurred((edges[b][1] - radii[j]) / blur) -
                                  blurred((edges[b][0] - radii[j]) / blur));
            share = in_dot[j] ? 1 : share;
            compare(m, of, &by, share, gray, paper, spread[b][j], at[LEVEL], at[LIGHT], at[NOISE],
                    at[WIDTH], at[MIXED_WIDTH], at[ANYTHING], densities[j][0], densities[j][n - 1]);
            for (count s = 1; s < n - 1; s++)
                compare_mixed(m, of, share * shares[s], gray, paper, spread[b][j], at[MIXED_WIDTH],
                              densities[j][s]);
            for (count a = 0; a < m; a++)
                at[COUNTS][a] = spread[b][j][a] < NEVER_SEEN && gray[a] < of.told_below &&
                                radii[j] <= reach[b][a];
        }
        for (int half = 0; half < 2; half++)
            for (count a = 0; a < m; a++) {
                bool glare = false, hidden = false;
                for (count j = 0; j < d; j++) {
                    glare = glare || (ground[half][j] && levels[b][j][a] >= of.glare);
                    hidden = hidden || (ground[half][j] && is_covered(&it, levels[b][j][a]));
                }
                covered[b][half][a] = hidden;
                for (count j = 0; j < d && glare; j++)
                    if (ground[half][j] || in_band[half][j])
                        read[j][COUNTS][a] = 0;
            }
        count every = 0, outside = 0;
        for (count j = 0; j < d; j++)
            for (count a = 0; a < m && (ground[0][j] || ground[1][j]); a++) {
                float error = fabsf(read[j][LEVEL][a] - read[j][LIGHT][a]);
                bool seen = read[j][COUNTS][a] > 0;
                every += seen;
                outside += seen && error > (float)by.unlikely * read[j][WIDTH][a];
            }
        double surprise = (double)outside / (double)(every ? every : 1);
        lit[b] = (float)lesser(greater(surprise, by.least_doubt), by.most_doubt);
        float plate = gaps ? behind_a_plate(d, m, near, &by, read, scratch[0]) : 0;
        for (count a = 0; a < m; a++) {
            of_gap[a] = 0;
            for (count j = 0; j < d; j++)
                of_gap[a] += ground[0][j] ? read[j][LEVEL][a] / (float)gaps : 0;
            for (count half = 0; half < 2; half++)
                for (count s = 0; s < n; s++)
                    looks[b][half][s][a] = 0;
        }
        dot[b] = 0;
        for (count j = 0; j < d; j++) {
            float(*at)[m] = read[j];
            bool may_be_ink = gaps && (in_band[0][j] || in_band[1][j]);
            for (count a = 0; a < m; a++) {
                float step = fabsf(read[beyond][LEVEL][a] - of_gap[a]);
                float darker = (of_gap[a] - at[LIGHT][a]) * (it.polarity > 0 ? 1 : -1);
                bool ink = may_be_ink && step < (float)by.light_edge;
                ink = ink && darker > (float)by.light_edge;
                doubt[a] = ink ? greater_f(lit[b], plate) : lit[b];
            }
            for (count s = 0; s < n; s++)
                odds_of(m, of, weight[b], densities[j][s], doubt, at[ANYTHING], at[COUNTS], odds[s]);
            for (count a = 0; a < m && in_dot[j]; a++)
                dot[b] += odds[n - 1][a] - odds[0][a];
            for (count half = 0; half < 2; half++)
                for (count s = 0; s < n && (ground[half][j] || in_band[half][j]); s++)
                    for (count a = 0; a < m; a++)
                        looks[b][half][s][a] += odds[ground[half][j] ? 0 : s][a];
        }
    }
}
