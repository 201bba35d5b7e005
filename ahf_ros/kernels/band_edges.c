/* What is seen of bands in polar images, as families/ring/likelihood.py compares it: the evidence of
   the steps between a band and the ground beside it. All radii are in dot radii. */

#include <math.h>
#include <string.h>

#include "band_looks.h"

/* The circle of c below a radius, and how far that is from there to the next one. */
static inline count circle_below(count c, double innermost, double outermost, double radius,
                                 float *share)
{
    double spacing = (outermost - innermost) / (double)(c - 1);
    double place = greater(lesser((double)(c - 1), (radius - innermost) / spacing), 0.0);
    *share = (float)(place - (double)(count)place);
    return (count)place;
}

/* Gray values at a radius, between the two circles beside it. */
static void read_circle(count c, count m, const float image[c][m], double innermost,
                        double outermost, double radius, float *restrict values)
{
    float share;
    count low = circle_below(c, innermost, outermost, radius, &share);
    const float *below = image[low], *above = image[low + 1 < c ? low + 1 : low];
    for (count a = 0; a < m; a++)
        values[a] = below[a] * (1 - share) + above[a] * share;
}

/* Gray values at r radii of k targets, each in one of i images of c circles. */
void gray_at(count k, count i, count c, count m, count r, const float gray[i][c][m],
             const int64_t row[k], double innermost, const double outermost[k],
             const double radii[k][r], float values[k][r][m])
{
    for (count b = 0; b < k; b++)
        for (count j = 0; j < r; j++)
            read_circle(c, m, gray[within(row[b], i)], innermost, outermost[b], radii[b][j],
                        values[b][j]);
}

/* What is read at an edge of a band, on ground and on the band: gray values; shares of ink that
   blur leaves or brings there, of a bare band and of a marked one; and what readings count. */
enum { GROUND, BAND, BARE, MARKED, BARE_BAND, MARKED_BAND, COUNTS, READ };

/* Shares of ink at a radius: of the dot, and of the band. */
static inline void ink_at(const double edges[3], double blur, double at, double *dot, double *band)
{
    *dot = blurred((edges[0] - at) / blur);
    *band = blurred((edges[2] - at) / blur) - blurred((edges[1] - at) / blur);
}

/* Where a plate ends, its ground is read in the middle of the rim. */
static inline double on_ground(double radius, double plate, double outer)
{
    return plate < NEVER_SEEN ? lesser(radius, (plate + outer) / 2) : radius;
}

/* Read a circle, or where plates end, on ground, one in the middle of their rim: ink of the dot,
   white paper beyond a plate, which is as white ink, and the band. */
static void read_ring(count c, count m, const float image[c][m], const numbers *of,
                      const target *it, const double edges[3], const double plate[m], double radius,
                      bool ground, float *restrict gray, float *restrict bare,
                      float *restrict marked)
{
    double blur = it->blur / it->size, dot, band;
    read_circle(c, m, image, of->innermost, it->outermost, radius, gray);
    ink_at(edges, blur, radius, &dot, &band);
    for (count a = 0; a < m; a++) {
        bare[a] = (float)dot;
        marked[a] = (float)(dot + band);
    }
    for (count a = 0; a < m; a++) {
        if (!(plate[a] < NEVER_SEEN))
            continue;
        double at = ground ? on_ground(radius, plate[a], edges[2]) : radius;
        double beyond = 1 - blurred((plate[a] - at) / blur);
        float share;
        count low = circle_below(c, of->innermost, it->outermost, at, &share);
        ink_at(edges, blur, at, &dot, &band);
        gray[a] = image[low][a] * (1 - share) + image[low + 1 < c ? low + 1 : low][a] * share;
        bare[a] = (float)(dot + beyond);
        marked[a] = (float)(dot + beyond + band);
    }
}

/* Read both edges of a band, with radii of dot, inner and outer edge. */
static void read_edges(count c, count m, const float image[c][m], const numbers *of,
                       const target *it, const double edges[3], const double reach[m],
                       const double plate[m], float weight, float read[2][READ][m])
{
    double beside = (of->beside + greater(it->blur - of->soft, 0)) / it->size;
    beside = lesser(greater(beside, of->least_beside), of->most_beside);
    double before = lesser(beside, 0.5 * (edges[1] - edges[0]));
    double within = lesser(beside, 0.45 * (edges[2] - edges[1]));
    double ground[2] = {edges[1] - before, edges[2] + beside};
    double band[2] = {edges[1] + within, edges[2] - within};
    for (int side = 0; side < 2; side++) {
        float(*at)[m] = read[side];
        read_ring(c, m, image, of, it, edges, plate, ground[side], side == 1, at[GROUND], at[BARE],
                  at[MARKED]);
        read_ring(c, m, image, of, it, edges, plate, band[side], false, at[BAND], at[BARE_BAND],
                  at[MARKED_BAND]);
        for (count a = 0; a < m; a++) {
            double far = side ? on_ground(ground[1], plate[a], edges[2]) : band[0];
            bool visible = reach[a] >= greater(far, band[side]) && (!side || plate[a] > edges[2]);
            at[COUNTS][a] = visible ? weight : 0;
        }
    }
}

/* Probability of an edge of light between neighbours, as two circles in the gap show it. */
static double light_edges(count c, count m, const float image[c][m], const numbers *of,
                          const target *it, const double edges[3], float circles[2][m])
{
    float least = (float)(of->light_edge * of->light_edge), offset = (float)of->offset;
    float noise = (float)it->noise, many = 0;
    for (int side = 0; side < 2; side++) {
        double at = edges[0] + (edges[1] - edges[0]) * of->across[side];
        read_circle(c, m, image, of->innermost, it->outermost, at, circles[side]);
    }
    for (count a = 0; a < m; a++) {
        float first = greater_f(circles[0][a], 0) + offset;
        float second = greater_f(circles[1][a], 0) + offset;
        float step = logarithm_f(first / second);
        float of_first = noise / first, of_second = noise / second;
        float noisy = least + 4 * (of_first * of_first + of_second * of_second);
        many += step * step > noisy ? 1.0f : 0.0f;
    }
    return lesser(greater(many / (double)m, of->least_doubt), of->most_doubt);
}

/* How steps of ln at an edge are spread: density of anything; the step of a mark; deviation of
   paper, and mean one of ink; variance of noise; the darker one of the ground on both sides; and what
   readings count that tell anything. */
enum { ANYTHING, MARK, SPREAD, WIDTH, KNOWN, LOWER, TOLD, STEPS };

/* Raise the densities of a share of ink to those of bright ink on black ground. */
static void share_in_the_dark(count m, look of, float share, const float *restrict beside,
                              const float *restrict here, const float *restrict bare,
                              const float *restrict marked, const float *restrict bare_here,
                              const float *restrict marked_here, float *restrict density)
{
    for (count a = 0; a < m && of.brightest > 0; a++) {
        float on_ground = bare[a] + share * (marked[a] - bare[a]);
        float on_band = bare_here[a] + share * (marked_here[a] - bare_here[a]);
        float ink = printed(of, beside[a], on_ground, on_band, here[a]);
        density[a] = greater_f(density[a], in_the_dark(of, share, ink, here[a], of.noise));
    }
}

/* Log odds of paper and of ink, against anything, from the steps of ln between the ground beside an
   edge, of which `lower` is the darker one of both, and the band there. Where glare makes the ground
   on both sides white, paper between is white. No array is another one, so that a compiler can take
   several angles at a time. */
static void paper_and_ink(count m, look of, const float *restrict lower, const float *restrict beside,
                          const float *restrict here, const float *restrict bare,
                          const float *restrict marked, const float *restrict bare_here,
                          const float *restrict marked_here, const float *restrict counts,
                          float *restrict anything, float *restrict mark, float *restrict spread,
                          float *restrict mean_width, float *restrict known, float *restrict paper,
                          float *restrict ink)
{
    for (count a = 0; a < m; a++) {
        float gray_ink = printed(of, beside[a], marked[a], marked_here[a], here[a]);
        float level = raised(of, here[a]), below = raised(of, beside[a]);
        float of_ink = raised(of, gray_ink);
        float blank = raised(of, printed(of, beside[a], bare[a], bare_here[a], here[a]));
        float step = logarithm_f(of_ink / below);
        float flat = lower[a] >= of.white ? of.of_white : of.flat;
        float of_noise = of.noise / level, of_ground = of.noise / below;
        spread[a] = sqrtf(flat * flat + of_noise * of_noise + of_ground * of_ground);
        float as_paper = normal_density_f(logarithm_f(level / blank), spread[a]);
        anything[a] = of.plain * as_paper + (1 - of.plain) * of.any;
        /* An error of ground is one of its light, also where that is black. */
        float some = greater_f(beside[a], 1);
        float gain = printed(of, some, marked[a], marked_here[a], here[a]) / some;
        float ink_ground = of_ground * gain * (below / of_ink);
        known[a] = of_noise * of_noise + ink_ground * ink_ground;
        float low = sqrtf(of.mark * of.mark + known[a]);
        float high = sqrtf(of.tail * of.tail + known[a]);
        float more = logarithm_f(level / of_ink);
        more = step < 0 ? -more : more;
        float width = more > 0 ? high : low;
        float as_ink = normal_density_f(more, width) * (2 * width / (low + high));
        /* Glare makes the step of a mark smaller. */
        float size = fabsf(step), under_glare = 1 / greater_f(size, of.flat);
        under_glare = beside[a] >= of.glare ? under_glare : 0;
        under_glare = more < 0 ? under_glare : 0;
        under_glare = more > -size ? under_glare : 0;
        ink[a] = greater_f(as_ink, under_glare);
        mark[a] = step;
        mean_width[a] = (low + high) / 2;
        paper[a] = counts[a] * log_odds(of, as_paper, of.doubt, anything[a]);
    }
    share_in_the_dark(m, of, 1, beside, here, bare, marked, bare_here, marked_here, ink);
    for (count a = 0; a < m; a++)
        ink[a] = counts[a] * log_odds(of, ink[a], of.doubt, anything[a]);
}

/* The same of a share of ink between paper and ink. */
static void mixed_ink(count m, look of, float share, const float *restrict beside,
                      const float *restrict here, const float *restrict bare,
                      const float *restrict marked, const float *restrict bare_here,
                      const float *restrict marked_here, const float *restrict counts,
                      const float *restrict anything, const float *restrict mark,
                      const float *restrict known, float *restrict odds)
{
    for (count a = 0; a < m; a++) {
        float on_ground = bare[a] + share * (marked[a] - bare[a]);
        float on_band = bare_here[a] + share * (marked_here[a] - bare_here[a]);
        float mixed = raised(of, printed(of, beside[a], on_ground, on_band, here[a]));
        float of_share = of.share * mark[a];
        float width = sqrtf(of.mark * of.mark + of_share * of_share + known[a]);
        odds[a] = normal_density_f(logarithm_f(raised(of, here[a]) / mixed), width);
    }
    share_in_the_dark(m, of, share, beside, here, bare, marked, bare_here, marked_here, odds);
    for (count a = 0; a < m; a++)
        odds[a] = counts[a] * log_odds(of, odds[a], of.at_ends, anything[a]);
}

/* What paper and ink give on average if they look as they should. */
static void as_they_should(count m, look of, const float *restrict counts,
                           const float *restrict mark, const float *restrict spread,
                           const float *restrict width, float *restrict paper,
                           float *restrict ink)
{
    float at_edge = of.doubt * logarithm_f(of.doubt / (1 - of.plain));
    for (count a = 0; a < m; a++) {
        float as_paper = normal_density_f(0, spread[a]), as_ink = normal_density_f(0, width[a]);
        float any = (1 - of.plain) * of.any, flat = of.plain * as_paper + any;
        float step = of.plain * normal_density_f(mark[a], spread[a]) + any;
        float of_paper = (1 - of.doubt) * log_odds(of, as_paper, of.doubt, flat) + at_edge;
        float of_ink = (1 - of.doubt) * log_odds(of, as_ink, of.doubt, step) + at_edge;
        paper[a] = counts[a] * of_paper;
        ink[a] = counts[a] * of_ink;
    }
}

/* Log odds of paper, [0], of shares of ink between and of ink, [n - 1], at one edge of a band. */
static void step_odds(count m, count n, look of, const float shares[n], float read[2][READ][m],
                      int side, float steps[STEPS][m], float looks[n][m])
{
    float(*at)[m] = read[side];
    for (count a = 0; a < m; a++) {
        float counts = at[COUNTS][a];
        steps[LOWER][a] = lesser_f(read[0][GROUND][a], read[1][GROUND][a]);
        steps[TOLD][a] = at[BAND][a] < of.told_below ? counts : 0;
    }
    paper_and_ink(m, of, steps[LOWER], at[GROUND], at[BAND], at[BARE], at[MARKED], at[BARE_BAND],
                  at[MARKED_BAND], steps[TOLD], steps[ANYTHING], steps[MARK], steps[SPREAD],
                  steps[WIDTH], steps[KNOWN], looks[0], looks[n - 1]);
    for (count s = 1; s < n - 1; s++)
        mixed_ink(m, of, shares[s], at[GROUND], at[BAND], at[BARE], at[MARKED], at[BARE_BAND],
                  at[MARKED_BAND], steps[TOLD], steps[ANYTHING], steps[MARK], steps[KNOWN], looks[s]);
}

/* Where something covers the ground beside either edge of a band. Ground in shadow, or dark ground in
   a stronger light, shows marks that are darker, or brighter, than elsewhere; a cover shows none. */
static void covered_ground(count m, count n, look of, const target *it, float light_edge,
                           float marked_share, float read[2][READ][m], float looks[2][n][m],
                           float lit[2][m], bool covered[2][m])
{
    float shade = (float)it->shade;
    count every = 0, marked = 0; /* and `lit`, ground as paper */
    for (int side = 0; side < 2; side++)
        for (count a = 0; a < m; a++) {
            float ground = read[side][GROUND][a], here = read[side][BAND][a];
            lit[side][a] = greater_f(ground, ground / (1 + read[side][MARKED][a] * (of.ink - 1)));
            bool differs = read[side][COUNTS][a] > 0 && is_covered(it, lit[side][a]);
            covered[side][a] = differs;
            every += differs;
            float ink = printed(of, shade, 0, 1, here);
            marked += differs && looks[side][n - 1][a] > looks[side][0][a] &&
                      (it->polarity > 0 ? here < ink : here > ink);
        }
    bool is_light = (float)marked > marked_share * (float)every;
    for (count a = 0; a < m; a++) {
        bool ground_as_ink[2], across = true, differs[2];
        if (!covered[0][a] && !covered[1][a])
            continue;
        for (int side = 0; side < 2; side++) {
            differs[side] = covered[side][a] && !is_light;
            float as_ink = logarithm_f(raised(of, printed(of, shade, 0, 1, lit[side][a])));
            float of_ground = logarithm_f(raised(of, read[side][GROUND][a]));
            float of_band = logarithm_f(raised(of, read[side][BAND][a]));
            ground_as_ink[side] = fabsf(of_ground - as_ink) < light_edge;
            across &= fabsf(of_band - as_ink) < light_edge;
        }
        /* The border of what is like ink looks like the edge of a mark. */
        for (int side = 0; side < 2; side++)
            covered[side][a] =
                differs[side] || (differs[1 - side] && ground_as_ink[1 - side] && across);
    }
}

/* Log odds of paper, of shares of ink and of ink in bands against anything, [0] at the inner edge
   and [1] at the outer one, of k targets that are each in one of i images of c circles; what paper
   and ink give on average; and where something covers the ground. `lit` is the probability of an
   edge of light between neighbours. */
void edge_evidence(rows k, count i, count c, count m, count n, const float gray[i][c][m],
                   const int64_t row[k], const double reach[k][m], const double plate[k][m],
                   const double looks_of[k][9], const double edges[k][3], const float weight[k],
                   const float shares[n], const double deciding[24], float looks[k][2][n][m],
                   float typical[k][2][2][m], bool covered[k][2][m], float lit[k],
                   float read[2][7][m], float steps[7][m])
{
    numbers of;
    target it;
    memcpy(&of, deciding, sizeof of);
    for (count b = 0; b < k; b++) {
        const float(*image)[m] = gray[within(row[b], i)];
        memcpy(&it, looks_of[b], sizeof it);
        lit[b] = (float)light_edges(c, m, image, &of, &it, edges[b], steps);
        look seen = look_of(&of, &it, lit[b]);
        read_edges(c, m, image, &of, &it, edges[b], reach[b], plate[b], weight[b], read);
        for (int side = 0; side < 2; side++) {
            step_odds(m, n, seen, shares, read, side, steps, looks[b][side]);
            as_they_should(m, seen, steps[TOLD], steps[MARK], steps[SPREAD], steps[WIDTH],
                           typical[b][side][0], typical[b][side][1]);
        }
        covered_ground(m, n, seen, &it, (float)of.light_edge, (float)of.marked_share, read, looks[b],
                       steps, covered[b]);
    }
}

/* The same of paper and of ink at s places of edges, both edges together. */
void shifted_evidence(rows k, count i, count c, count m, count s, const float gray[i][c][m],
                      const int64_t row[k], const double reach[k][m], const double plate[k][m],
                      const double looks_of[k][9], const double edges[k][s][3],
                      const float weight[k], const double deciding[24], float looks[k][s][2][m],
                      float read[2][7][m], float steps[7][m], float of_edges[2][2][m])
{
    static const float shares[2] = {0, 1};
    numbers of;
    target it;
    memcpy(&of, deciding, sizeof of);
    for (count b = 0; b < k; b++)
        for (count shift = 0; shift < s; shift++) {
            const float(*image)[m] = gray[within(row[b], i)];
            const double *at = edges[b][shift];
            memcpy(&it, looks_of[b], sizeof it);
            float lit = (float)light_edges(c, m, image, &of, &it, at, steps);
            look seen = look_of(&of, &it, lit);
            read_edges(c, m, image, &of, &it, at, reach[b], plate[b], weight[b], read);
            for (int side = 0; side < 2; side++)
                step_odds(m, 2, seen, shares, read, side, steps, of_edges[side]);
            for (int ink = 0; ink < 2; ink++)
                for (count a = 0; a < m; a++)
                    looks[b][shift][ink][a] = of_edges[0][ink][a] + of_edges[1][ink][a];
        }
}
