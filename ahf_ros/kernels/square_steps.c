/* What the steps between the cells of quadrilaterals say of square markers. */

#include <math.h>
#include <string.h>

#include "elementary.h"
#include "kernels.h"
#include "robust.h"
#include "square.h"

enum { FALLING, SAME, RISING, KINDS };

#define NOTICED 1e-3 /* least share of other cells in the light of one that is taken out */

/* Logarithms of the light of a grid's cells and of those around it, each in one place, in cells from
   its middle: across lines, and along them. What blur, in cells, mixes in from other cells is taken
   out. */
static void set_light(count h, count w, count c, const uint8_t gray[h][w],
                      const double frame[3][3], int axis, const double place[2],
                      const double blur[2], double offset, double scale[c], double light[c][c])
{
    double side = (double)(c - 2), middle = (double)(c - 1) / 2;
    for (count line = 0; line < c; line++)
        for (count cell = 0; cell < c; cell++) {
            double at[2] = {((double)line - middle + place[0]) / side,
                            ((double)cell - middle + place[1]) / side};
            light[line][cell] = sampled(h, w, gray, frame, at[axis], at[1 - axis]);
        }
    for (int way = 0; way < 2; way++) {
        double before = normal_share(-(0.5 + place[way]) / blur[way]);
        double behind = normal_share(-(0.5 - place[way]) / blur[way]);
        if (before + behind > NOTICED)
            unmix(c, before, behind, light, scale);
        transpose(c, light);
    }
    set_logarithms(c * c, light[0], offset);
}

/* Steps of the logarithm across the lines between the cells of a grid, upright lines first. */
static void set_steps(count h, count w, count t, count s, count m, count c,
                      const uint8_t gray[h][w], const double frame[3][3], const double places[m],
                      double aside, double offset, const double blurs[2], double scale[c],
                      double light[2][c][c], double steps[2][t][s][m])
{
    for (int axis = 0; axis < 2; axis++) {
        double blur[2] = {blurs[axis], blurs[1 - axis]};
        for (count i = 0; i < m; i++) {
            for (int behind = 0; behind < 2; behind++) {
                double place[2] = {behind ? aside - 0.5 : 0.5 - aside, places[i]};
                set_light(h, w, c, gray, frame, axis, place, blur, offset, scale, light[behind]);
            }
            for (count line = 0; line < t; line++)
                for (count cell = 0; cell < s; cell++)
                    steps[axis][line][cell][i] =
                        light[1][line + 1][cell + 1] - light[0][line][cell + 1];
        }
    }
}

/* The usual step across the sides of a grid, towards paper. */
static double step_of_sides(count t, count s, count m, const double steps[2][t][s][m],
                            double sides[4 * s * m])
{
    count n = 0;
    for (int axis = 0; axis < 2; axis++)
        for (count cell = 0; cell < s; cell++)
            for (count i = 0; i < m; i++) {
                sides[n++] = -steps[axis][0][cell][i];
                sides[n++] = steps[axis][t - 1][cell][i];
            }
    return middle(n, sides);
}

/* Likelihood, up to what is the same for all kinds, of a step, as a share of the usual one: light
   makes any step of some. */
static inline double likelihood_of(double share, int kind, double deviation, double stray)
{
    double away = (share - (kind - SAME)) / deviation;
    return exponential(-away * away / 2) + stray;
}

/* Logarithmic odds of all kinds of a line between two cells, against what else may be there. */
static void set_odds(count m, const double steps[m], double usual, double deviation, double stray,
                     double weight, double odds[KINDS])
{
    static const double expected[KINDS] = {0.25, 0.5, 0.25};
    double any = 0;
    for (int kind = 0; kind < KINDS; kind++) {
        double likelihood = 1;
        for (count i = 0; i < m; i++)
            likelihood *= likelihood_of(steps[i] / usual, kind, deviation, stray);
        odds[kind] = weight * logarithm(likelihood);
    }
    for (int kind = 0; kind < KINDS; kind++)
        any += expected[kind] * exponential(odds[kind] - odds[SAME]);
    any = logarithm(any) + odds[SAME];
    for (int kind = 0; kind < KINDS; kind++)
        odds[kind] -= any;
}

/* Logarithmic odds of square corners, each in its own light: of ink in the middle of its cell, and of
   the darker paper beyond its sides. */
static double corners_odds(count h, count w, count s, const uint8_t gray[h][w],
                           const double frame[3][3], double offset, const double corner[4],
                           const double shown[2])
{
    double middle = 0.5 - 0.5 / (double)s, outermost = 0.5 - corner[0] / (double)s;
    double outside = 0.5 + 0.5 / (double)s, odds = 0;
    for (int i = 0; i < 4; i++) {
        double x = i % 2 ? 1 : -1, y = i / 2 ? 1 : -1;
        double across = sampled(h, w, gray, frame, x * outside, y * middle);
        double down = sampled(h, w, gray, frame, x * middle, y * outside);
        double ink = logarithm(sampled(h, w, gray, frame, x * middle, y * middle) + offset);
        double paper = logarithm(lesser(across, down) + offset);
        double seen = logarithm(sampled(h, w, gray, frame, x * outermost, y * outermost) + offset);
        if (paper > ink)
            odds += bounded(corner_odds(seen, (ink + paper) / 2, paper - ink, shown, corner[2]),
                            corner[3]);
    }
    return odds;
}

void step_evidence(count h, count w, rows k, count s, count t, count n, count f, count m,
                   count c, const uint8_t gray[h][w], const double frames[k][3][3],
                   const double sizes[k][2], const double places[m], double aside, double offset,
                   double least, const double deviation[2], double stray, double weight,
                   double of_border, const double corner[4], bool seen[k], float features[k][f],
                   double odds[3][k], double scale[c], double light[2][c][c],
                   double steps[2][t][s][m], double sides[4][s][m])
{
    count border = (s - n) / 2;
    for (count i = 0; i < k; i++) {
        double ink = 0, around = 0, shown[2], blurs[2], spread[2];
        for (int axis = 0; axis < 2; axis++)
            blurs[axis] = corner[1] / sizes[i][axis];
        memset(features[i], 0, sizeof features[i]);
        set_steps(h, w, t, s, m, c, gray, frames[i], places, aside, offset, blurs, scale, light,
                  steps);
        double usual = step_of_sides(t, s, m, steps, sides[0][0]);
        seen[i] = usual > least;
        for (int axis = 0; axis < 2; axis++)
            spread[axis] = deviation[0] + deviation[1] * normal_share(-aside / blurs[axis]);
        /* What is inside tells nothing where there is no border. */
        for (int inside = 0; inside < 2 && seen[i] && (!inside || around > 0); inside++)
            for (int axis = 0; axis < 2; axis++)
                for (count line = 0; line < t; line++)
                    for (count cell = 0; cell < s; cell++) {
                        count column = line - border, row = cell - border;
                        if (inside != (row >= 0 && row < n && column >= 0 && column <= n))
                            continue;
                        double of[KINDS];
                        const double *own = steps[axis][line][cell];
                        set_odds(m, own, usual, spread[axis], stray, weight, of);
                        if (!inside) {
                            around += of[line == 0 ? FALLING : line == t - 1 ? RISING : SAME];
                            continue;
                        }
                        count at = 2 * (((count)axis * (n + 1) + column) * n + row);
                        ink += of[SAME];
                        for (int rises = 0; rises < 2 && at + rises < f; rises++)
                            features[i][at + rises] =
                                (float)(of[rises ? RISING : FALLING] - of[SAME]);
                    }
        odds[INK][i] = ink + of_border * around;
        for (int axis = 0; axis < 2; axis++)
            shown[axis] = normal_share(corner[0] / blurs[axis]);
        odds[SQUARE][i] = corners_odds(h, w, s, gray, frames[i], offset, corner, shown);
        odds[AROUND][i] = around;
    }
}
