/* What the cells of quadrilaterals say of square markers. */

#include <math.h>

#include "elementary.h"
#include "images.h"
#include "kernels.h"
#include "robust.h"

enum { SIDES = 4, PARTS = 5 };
/* Sums along sides of a border, over which levels of ink and paper are known. */
enum { TOTAL, MIDDLES, STEPS, SUMS };
/* Logarithmic odds of a marker whose cells are ink, of square corners, and of the border. */
enum { INK, SQUARE, AROUND };

static double sampled(count h, count w, const uint8_t gray[h][w], const double frame[3][3],
                      double x, double y)
{
    double scale = frame[2][0] * x + frame[2][1] * y + frame[2][2];
    return byte_at(h, w, gray, (frame[0][0] * x + frame[0][1] * y + frame[0][2]) / scale,
                   (frame[1][0] * x + frame[1][1] * y + frame[1][2]) / scale);
}

void dark_inside(count h, count w, count k, count n, const uint8_t gray[h][w],
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

/* Take from the lines of a square what blur mixed into each from its neighbours, by elimination. */
static void unmix(count n, double share, double values[n][n], double scale[n])
{
    for (count row = 0; row < n; row++) {
        bool end = row == 0 || row == n - 1;
        double own = end ? 1 - share : 1 - 2 * share;
        scale[row] = row ? 1 / (own - share * share * scale[row - 1]) : 1 / own;
        for (count column = 0; column < n; column++) {
            double before = row ? share * values[row - 1][column] : 0;
            values[row][column] = (values[row][column] - before) * scale[row];
        }
    }
    for (count row = n - 2; row >= 0; row--)
        for (count column = 0; column < n; column++)
            values[row][column] -= share * scale[row] * values[row + 1][column];
}

static void transpose(count n, double values[n][n])
{
    for (count row = 0; row < n; row++)
        for (count column = 0; column < row; column++) {
            double swapped = values[row][column];
            values[row][column] = values[column][row];
            values[column][row] = swapped;
        }
}

/* Logarithms of cells as a whole, their darkest parts where light is spread, and of their parts. */
static void set_levels(count h, count w, count s, const uint8_t gray[h][w],
                       const double frame[3][3], const double places[PARTS][2],
                       const double shares[2], bool spread, double offset,
                       double levels[PARTS][s][s], double scale[s])
{
    double side = (double)(s - 2), middle = (double)(s - 1) / 2;
    for (int part = spread ? 0 : 1; part < PARTS; part++)
        for (count row = 0; row < s; row++)
            for (count column = 0; column < s; column++) {
                double x = ((double)column - middle + places[part][0]) / side;
                double y = ((double)row - middle + places[part][1]) / side;
                levels[part][row][column] = sampled(h, w, gray, frame, x, y);
            }
    for (count row = 0; row < s; row++)
        for (count column = 0; column < s; column++) {
            double sum = 0, least = levels[0][row][column];
            for (int part = 1; part < PARTS; part++) {
                sum += levels[part][row][column];
                least = lesser(least, levels[part][row][column]);
            }
            levels[0][row][column] = spread ? least : sum / (PARTS - 1);
        }
    unmix(s, shares[1], levels[0], scale);
    transpose(s, levels[0]);
    unmix(s, shares[0], levels[0], scale);
    transpose(s, levels[0]);
    double *all = levels[0][0];
    for (count cell = 0; cell < PARTS * s * s; cell++)
        all[cell] = logarithm(greater(all[cell], 0) + offset);
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

void cell_evidence(count h, count w, count k, count s, count n, const uint8_t gray[h][w],
                   const double frames[k][3][3], const double sizes[k][2], const double blurs[k],
                   const bool spread[k], const double window[s], const double places[5][2],
                   double offset, double most_mixed, double minimum_step, double of_usual,
                   double share, double everywhere, double sharpness, double most, double unclear,
                   double unusual, const double weights[3], double corner, bool seen[k],
                   float paper[k][n][n], double odds[3][k], double levels[5][s][s],
                   double sums[6][3][s])
{
    count border = (s - 2 - n) / 2, last = s - 2;
    for (count i = 0; i < k; i++) {
        seen[i] = false;
        odds[INK][i] = odds[SQUARE][i] = odds[AROUND][i] = 0;
        if (border < 1)
            continue;
        double of_part = weights[0], of_border = weights[1], of_corner = weights[2];
        double shares[2], shown[2], all[SUMS], usual;
        for (int axis = 0; axis < 2; axis++) {
            shares[axis] = lesser(normal_share(-sizes[i][axis] / blurs[i] / 2), most_mixed);
            shown[axis] = normal_share(corner * sizes[i][axis] / blurs[i]);
        }
        set_levels(h, w, s, gray, frames[i], places, shares, spread[i], offset, levels,
                   sums[SIDES][0]);
        seen[i] = set_sums(s, levels[0], window, minimum_step, of_usual, share, sums[SIDES][0], sums,
                           all, &usual);
        if (!seen[i])
            continue;
        struct step least = least_step(s, levels[0], usual, minimum_step);
        for (count row = 1; row <= last; row++)
            for (count column = 1; column <= last; column++) {
                double mean[SUMS];
                for (int sum = 0; sum < SUMS; sum++)
                    mean[sum] = window[row - 1] * sums[0][sum][column] +
                                window[last - column] * sums[1][sum][row] +
                                window[last - row] * sums[2][sum][column] +
                                window[column - 1] * sums[3][sum][row] + everywhere * all[sum];
                double half = mean[MIDDLES] / mean[TOTAL], step = mean[STEPS] / mean[TOTAL];
                if (least.whole > 0)
                    half = least.half, step = least.whole;
                double of_parts[PARTS], parts = 0, product = 1;
                for (int part = 0; part < PARTS; part++) {
                    double of = sharpness * (levels[part][row][column] - half) / step;
                    of_parts[part] = lesser(greater(of, -most), most);
                    if (part) {
                        parts += of_parts[part];
                        product *= (1 + exponential(of_parts[part])) / 2;
                    }
                }
                double against = -logarithm((1 + exponential(of_parts[0])) / 2);
                against -= of_part * logarithm(product) + unclear * (1 - fabs(of_parts[0]) / most);
                count r = row - 1 - border, c = column - 1 - border;
                if (r >= 0 && r < n && c >= 0 && c < n) {
                    paper[i][r][c] = (float)(of_parts[0] + of_part * parts);
                    odds[INK][i] += against;
                    continue;
                }
                odds[AROUND][i] += of_border * against;
                bool top = row == 1, left = column == 1;
                if ((top || row == last) && (left || column == last)) {
                    odds[AROUND][i] += of_corner * against;
                    /* The outermost part is as bright as paper if the corner is round. */
                    double dark = exponential(-step / 2), bright = exponential(step / 2);
                    double outermost = levels[1 + !top + 2 * !left][row][column];
                    double level = (exponential(outermost - half) - dark) / (bright - dark);
                    double blurred = 1 - shown[0] * shown[1];
                    double of = sharpness * (1 - blurred) * ((1 + blurred) / 2 - level);
                    odds[SQUARE][i] += lesser(greater(of, -most), most);
                }
            }
        double against = unusual * (spread[i] + (least.whole > 0));
        odds[INK][i] += odds[AROUND][i] - against;
        odds[SQUARE][i] -= against;
    }
}
