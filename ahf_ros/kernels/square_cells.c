/* What the cells of quadrilaterals say of square markers. */

#include <math.h>

#include "elementary.h"
#include "images.h"
#include "kernels.h"
#include "robust.h"
#include "square.h"

enum { SIDES = 4, PARTS = 5 };
/* Planes of cells as a whole, by the mean and by the darkest of their parts; parts are between. */
enum { MEAN, DARKEST = PARTS, PLANES };
/* Sums along sides of a border, over which levels of ink and paper are known. */
enum { TOTAL, MIDDLES, STEPS, SUMS };

void dark_inside(count h, count w, rows k, count n, const uint8_t gray[h][w],
                 const double frames[k][3][3], const double along[n], double outside,
                 double inside, double offset, double times, double share, bool dark[k])
{
    static const double turns[SIDES][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    for (count i = 0; i < k; i++) {
        dark[i] = true;
        for (int side = 0; side < SIDES && dark[i]; side++) {
            double c = turns[side][0], s = turns[side][1], steps = 0;
            for (count j = 0; j < n; j++) {
                double x = c * along[j], y = s * along[j];
                double paper = sampled(h, w, gray, frames[i], x + s * outside, y - c * outside);
                double ink = sampled(h, w, gray, frames[i], x + s * inside, y - c * inside);
                steps += paper + offset > times * (ink + offset);
            }
            dark[i] = steps >= share * (double)n;
        }
    }
}

/* Cells as a whole, without what blur mixes into each: by the mean of their parts in the first
   plane, and by the darkest of these and of their middle in the last one; parts between. */
static void set_cells(count h, count w, count s, const uint8_t gray[h][w],
                      const double frame[3][3], const double places[PARTS][2],
                      const double shares[2], double levels[PLANES][s][s], double scale[s])
{
    double side = (double)(s - 2), middle = (double)(s - 1) / 2;
    for (count row = 0; row < s; row++)
        for (count column = 0; column < s; column++) {
            double sum = 0, least = INFINITY;
            for (int part = 0; part < PARTS; part++) {
                double x = ((double)column - middle + places[part][0]) / side;
                double y = ((double)row - middle + places[part][1]) / side;
                double level = sampled(h, w, gray, frame, x, y);
                least = lesser(least, level);
                sum += part ? level : 0;
                levels[part][row][column] = level;
            }
            levels[MEAN][row][column] = sum / (PARTS - 1);
            levels[DARKEST][row][column] = least;
        }
    for (int plane = MEAN; plane < PLANES; plane += DARKEST - MEAN) {
        unmix(s, shares[1], shares[1], levels[plane], scale);
        transpose(s, levels[plane]);
        unmix(s, shares[0], shares[0], levels[plane], scale);
        transpose(s, levels[plane]);
    }
}

/* Cells of the border, and of paper beside it. */
struct pair {
    double ink, paper;
};

static struct pair pair_at(count s, const double level[s][s], int side, count j)
{
    switch (side) {
    case 0:
        return (struct pair){level[1][j], level[0][j]};
    case 1:
        return (struct pair){level[j][s - 2], level[j][s - 1]};
    case 2:
        return (struct pair){level[s - 2][j], level[s - 1][j]};
    default:
        return (struct pair){level[j][1], level[j][0]};
    }
}

/* Half of a step from ink to paper, and the step. */
struct step {
    double half, whole;
};

/* The step from the brightest ink of a border to the darkest paper, 0 where light is the same all
   round, or changes nearly as much as ink does. */
static struct step least_step(count s, const double level[s][s], double usual, double minimum_step)
{
    struct pair most = {-INFINITY, -INFINITY}, least = {INFINITY, INFINITY};
    for (int side = 0; side < SIDES; side++)
        for (count j = 2; j < s - 2; j++) { /* corners may be round */
            struct pair of = pair_at(s, level, side, j);
            most.ink = greater(most.ink, of.ink), least.ink = lesser(least.ink, of.ink);
            least.paper = lesser(least.paper, of.paper);
        }
    double step = least.paper - most.ink;
    bool used = most.ink - least.ink > usual / 2 && step > minimum_step / 2;
    return (struct step){(most.ink + least.paper) / 2, used ? step : 0};
}

/* Set sums over steps of the border, for each line; whether all sides have enough of these. */
static bool set_sums(count s, const double level[s][s], const double window[s],
                     double minimum_step, double of_usual, double share, double steps[SIDES * s],
                     double sums[SIDES + 2][SUMS][s], double all[SUMS], double *usual_step)
{
    count some = 0;
    for (int side = 0; side < SIDES; side++)
        for (count j = 1; j < s - 1; j++) {
            struct pair of = pair_at(s, level, side, j);
            steps[some++] = of.paper - of.ink;
        }
    double usual = *usual_step = middle(some, steps);
    if (!(usual > minimum_step))
        return false;
    for (int sum = 0; sum < SUMS; sum++)
        all[sum] = 0;
    for (int side = 0; side < SIDES; side++) {
        double clear = 0;
        for (int sum = 0; sum < SUMS; sum++)
            for (count line = 0; line < s; line++)
                sums[side][sum][line] = 0;
        for (count j = 1; j < s - 1; j++) {
            struct pair of = pair_at(s, level, side, j);
            double step = of.paper - of.ink, half = (of.ink + of.paper) / 2;
            if (!(step > of_usual * usual && step > minimum_step / 2))
                continue;
            clear++;
            all[TOTAL] += 1, all[MIDDLES] += half, all[STEPS] += step;
            for (count line = 0; line < s; line++) {
                double weight = window[line < j ? j - line : line - j];
                sums[side][TOTAL][line] += weight;
                sums[side][MIDDLES][line] += weight * half;
                sums[side][STEPS][line] += weight * step;
            }
        }
        if (!(clear >= share * (double)(s - 2)))
            return false;
    }
    return true;
}

/* Of the cells of a line: half of a step from ink to paper, and the step; odds of paper by the whole
   cell, and the sum of those by its parts; logarithms of what is more likely than either colour. */
enum { HALF, STEP, OF_WHOLE, OF_PARTS, WHOLE_AGAINST, PARTS_AGAINST, LINES };

/* Set the step of each cell of a row, the one from ink to paper in its light. */
static void set_line(count s, count row, const double window[s], double everywhere,
                     const double sums[SIDES][SUMS][s], const double all[SUMS], struct step least,
                     double line[LINES][s])
{
    count last = s - 2;
    for (count column = 1; column <= last; column++) {
        double mean[SUMS];
        for (int sum = 0; sum < SUMS; sum++)
            mean[sum] = window[row - 1] * sums[0][sum][column] +
                        window[last - column] * sums[1][sum][row] +
                        window[last - row] * sums[2][sum][column] +
                        window[column - 1] * sums[3][sum][row] + everywhere * all[sum];
        line[HALF][column] = least.whole > 0 ? least.half : mean[MIDDLES] / mean[TOTAL];
        line[STEP][column] = least.whole > 0 ? least.whole : mean[STEPS] / mean[TOTAL];
    }
}

/* Weigh the cells of a row, several at a time, as all loops are without a branch. */
static void weigh_line(count s, count row, const double whole[s][s],
                       const double levels[PARTS][s][s], double sharpness, double most,
                       double line[LINES][s])
{
    for (count c = 1; c < s - 1; c++) {
        double of = sharpness * (whole[row][c] - line[HALF][c]) / line[STEP][c];
        line[OF_WHOLE][c] = bounded(of, most);
        line[OF_PARTS][c] = 0;
        line[PARTS_AGAINST][c] = 1;
    }
    for (int part = 1; part < PARTS; part++)
        for (count c = 1; c < s - 1; c++) {
            double of = sharpness * (levels[part][row][c] - line[HALF][c]) / line[STEP][c];
            line[OF_PARTS][c] += bounded(of, most);
            line[PARTS_AGAINST][c] *= (1 + exponential(bounded(of, most))) / 2;
        }
    for (count c = 1; c < s - 1; c++) {
        line[WHOLE_AGAINST][c] = logarithm((1 + exponential(line[OF_WHOLE][c])) / 2);
        line[PARTS_AGAINST][c] = logarithm(line[PARTS_AGAINST][c]);
    }
}

void cell_evidence(count h, count w, rows k, count s, count n, const uint8_t gray[h][w],
                   const double frames[k][3][3], const double sizes[k][2], const double blurs[k],
                   const bool spread[k], const double window[s], const double places[5][2],
                   double offset, double most_mixed, double minimum_step, double of_usual,
                   double share, double everywhere, double sharpness, double most, double unclear,
                   double unusual, const double weights[3], double corner, bool seen[2][k],
                   float paper[2][k][n][n], double odds[3][2][k], double levels[6][s][s],
                   double sums[6][3][s])
{
    count border = (s - 2 - n) / 2, last = s - 2;
    double of_part = weights[0], of_border = weights[1], of_corner = weights[2];
    for (count i = 0; i < k; i++) {
        double shares[2], shown[2], all[SUMS], usual;
        bool logarithms = false;
        for (int axis = 0; axis < 2; axis++) {
            shares[axis] = lesser(normal_share(-sizes[i][axis] / blurs[i] / 2), most_mixed);
            shown[axis] = normal_share(corner * sizes[i][axis] / blurs[i]);
        }
        set_cells(h, w, s, gray, frames[i], places, shares, levels, sums[SIDES][0]);
        for (int reading = 0; reading < 2; reading++) {
            double(*whole)[s] = levels[reading ? DARKEST : MEAN];
            double ink = 0, square = 0, around = 0;
            seen[reading][i] = false;
            odds[INK][reading][i] = odds[SQUARE][reading][i] = odds[AROUND][reading][i] = 0;
            if (border < 1 || (reading && !spread[i]))
                continue;
            set_logarithms(s * s, whole[0], offset);
            if (!set_sums(s, whole, window, minimum_step, of_usual, share, sums[SIDES][0], sums,
                          all, &usual))
                continue;
            seen[reading][i] = true;
            if (!logarithms)
                set_logarithms((PARTS - 1) * s * s, levels[1][0], offset);
            logarithms = true;
            struct step least = least_step(s, whole, usual, minimum_step);
            double(*line)[s] = sums[SIDES];
            for (count row = 1; row <= last; row++) {
                set_line(s, row, window, everywhere, sums, all, least, line);
                weigh_line(s, row, whole, levels, sharpness, most, line);
                for (count column = 1; column <= last; column++) {
                    double half = line[HALF][column], step = line[STEP][column];
                    double of_whole = line[OF_WHOLE][column];
                    double against = -line[WHOLE_AGAINST][column];
                    against -= of_part * line[PARTS_AGAINST][column] +
                               unclear * (1 - fabs(of_whole) / most);
                    count r = row - 1 - border, c = column - 1 - border;
                    if (r >= 0 && r < n && c >= 0 && c < n) {
                        double parts = line[OF_PARTS][column];
                        paper[reading][i][r][c] = (float)(of_whole + of_part * parts);
                        ink += against;
                        continue;
                    }
                    around += of_border * against;
                    bool top = row == 1, left = column == 1;
                    if ((top || row == last) && (left || column == last)) {
                        around += of_corner * against;
                        double outermost = levels[1 + !top + 2 * !left][row][column];
                        double of = corner_odds(outermost, half, step, shown, sharpness);
                        square += bounded(of, most);
                    }
                }
            }
            double against = unusual * (reading + (least.whole > 0));
            odds[INK][reading][i] = ink + (around - against);
            odds[SQUARE][reading][i] = square - against;
            odds[AROUND][reading][i] = around;
        }
    }
}
