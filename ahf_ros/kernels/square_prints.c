/* Prints of square markers, laid over an image by least squares. */

#include <math.h>

#include "elementary.h"
#include "images.h"
#include "kernels.h"
#include "robust.h"

/* Unknowns: of a frame, its blur, then levels: of paper and its changes along x and y, of the step
   to ink and its changes, and the growth of ink. */
enum { PLACE = 8, BLUR = 8, PAPER = 9, STEP = 12, GROWTH = 15, UNKNOWNS = 16, TILE = 4 };
/* Blurred ink at samples, its changes by x, y and blur, and what is seen of it. */
enum { INK, BY_X, BY_Y, BY_BLUR, KNOWN, INSIDE, VALUE, RESIDUAL, RELATIVE, SORTED, FIELDS };
#define OVER_SQRT_2_PI 0.39894228040143267794

typedef double row_of_unknowns[UNKNOWNS];

static void add_product(count n, double factor, const double of[restrict n], double sum[restrict n])
{
    for (count i = 0; i < n; i++)
        sum[i] += factor * of[i];
}

/* Blurred ink at m by m places, and its changes. `share` is what each row or column of cells has of
   a place, with its changes by the place and by the blur. */
static void blur_print(count n, count m, const bool ink[n][n], const double places[m], double blur,
                       double share[3][n][m], double fields[FIELDS][m][m])
{
    for (count b = 0; b < m; b++) {
        double before[3] = {0};
        for (count edge = 0; edge <= n; edge++) {
            double away = (places[b] - ((double)edge / n - 0.5)) / blur;
            double density = exponential(-away * away / 2) * OVER_SQRT_2_PI / blur;
            double now[3] = {normal_share(away), density, -density * away};
            for (int change = 0; change < 3; change++) {
                if (edge)
                    share[change][edge - 1][b] = before[change] - now[change];
                before[change] = now[change];
            }
        }
    }
    for (count a = 0; a < m; a++) {
        for (int field = INK; field <= BY_BLUR; field++)
            for (count b = 0; b < m; b++)
                fields[field][a][b] = 0;
        for (count column = 0; column < n; column++) {
            double inked = 0, moved = 0, soft = 0;
            for (count row = 0; row < n; row++)
                if (ink[row][column]) {
                    inked += share[0][row][a];
                    moved += share[1][row][a];
                    soft += share[2][row][a];
                }
            const double *of = share[0][column];
            add_product(m, inked, of, fields[INK][a]);
            add_product(m, inked, share[1][column], fields[BY_X][a]);
            add_product(m, moved, of, fields[BY_Y][a]);
            add_product(m, soft, of, fields[BY_BLUR][a]);
            add_product(m, inked, share[2][column], fields[BY_BLUR][a]);
        }
    }
}

static inline double plane_at(const double plane[3], double x, double y)
{
    return plane[0] + plane[1] * x + plane[2] * y;
}

static inline double slope_at(count m, const double fields[FIELDS][m][m], count a, count b)
{
    return sqrt(squared(fields[BY_X][a][b]) + squared(fields[BY_Y][a][b]));
}

/* Derivatives of residuals of a row of samples by the unknowns. */
static void set_rows(count m, count a, const double places[m], bool grows,
                     const row_of_unknowns unknowns, const double fields[FIELDS][m][m],
                     row_of_unknowns rows[m])
{
    for (count b = 0; b < m; b++) {
        double x = places[b], y = places[a], ink = fields[INK][a][b];
        double step = plane_at(unknowns + STEP, x, y);
        double across = fields[BY_X][a][b] * step, down = fields[BY_Y][a][b] * step;
        double bent = across * x + down * y, soft = fields[BY_BLUR][a][b] * step;
        double slope = grows ? slope_at(m, fields, a, b) : 0;
        double row[UNKNOWNS] = {across,    down,      across * x, across * y, down * x, down * y,
                                -bent * x, -bent * y, -soft,      -1,         -x,       -y,
                                -ink,      -ink * x,  -ink * y,   -slope};
        for (int u = 0; u < UNKNOWNS; u++)
            rows[b][u] = row[u];
    }
}

/* Add products of four columns and four weighted columns of rows to a normal matrix. */
static void add_tile(count n, const row_of_unknowns rows[n], const row_of_unknowns weighted[n],
                     int u, int v, row_of_unknowns normal[UNKNOWNS])
{
    double sums[TILE][TILE] = {{0}};
    for (count j = 0; j < n; j++)
        for (int c = 0; c < TILE; c++)
            for (int d = 0; d < TILE; d++)
                sums[c][d] += weighted[j][u + c] * rows[j][v + d];
    for (int c = 0; c < TILE; c++)
        for (int d = 0; d < TILE; d++)
            normal[u + c][v + d] += sums[c][d];
}

enum weighing { EQUAL, ROBUST, GAIN };

static inline double weight_at(count m, const double fields[FIELDS][m][m], count a, count b,
                               enum weighing weighing)
{
    double relative = fields[RELATIVE][a][b], inside = fields[INSIDE][a][b];
    return weighing == EQUAL    ? inside
           : weighing == ROBUST ? inside * geman_mcclure(relative)
                                : inside * geman_mcclure_gain(relative);
}

/* Normal equations of the unknowns from `first` on, a multiple of four, for a field. */
static void normal_equations(count m, const double places[m], bool grows, enum weighing weighing,
                             int field, int first, const row_of_unknowns unknowns, double ridge,
                             const double fields[FIELDS][m][m], double samples[2][m][UNKNOWNS],
                             row_of_unknowns normal[UNKNOWNS], row_of_unknowns right)
{
    row_of_unknowns *rows = samples[0], *weighted = samples[1], sums = {0};
    for (int u = 0; u < UNKNOWNS; u++)
        for (int v = 0; v < UNKNOWNS; v++)
            normal[u][v] = 0;
    for (count a = 0; a < m; a++) {
        count n = 0; /* samples of the row that count */
        set_rows(m, a, places, grows, unknowns, fields, rows);
        for (count b = 0; b < m; b++) {
            if (!fields[INSIDE][a][b])
                continue;
            double weight = weight_at(m, fields, a, b, weighing), value = fields[field][a][b];
            for (int u = 0; u < UNKNOWNS; u++) {
                rows[n][u] = rows[b][u];
                weighted[n][u] = weight * rows[b][u];
                sums[u] += weighted[n][u] * value;
            }
            n++;
        }
        for (int u = first; u < UNKNOWNS; u += TILE)
            for (int v = u; v < UNKNOWNS; v += TILE)
                add_tile(n, rows, weighted, u, v, normal);
    }
    for (int u = first; u < UNKNOWNS; u++) {
        right[u] = sums[u];
        normal[u][u] += ridge * normal[u][u] + ridge;
        for (int v = first; v < u; v++)
            normal[u][v] = normal[v][u];
    }
}

/* Covariance of the first two unknowns, from residuals that have anything in common within a cell:
   Liang & Zeger, Biometrika 73(1), 1986. `sums` are of both, and of weights. */
static void set_covariance(count m, count g, const double places[m], const int32_t cells[m],
                           bool grows, const row_of_unknowns unknowns,
                           const double fields[FIELDS][m][m], row_of_unknowns rows[m],
                           row_of_unknowns normal[UNKNOWNS], double sums[g][g][3],
                           double covariance[2][2])
{
    double inverse[UNKNOWNS][2] = {{1, 0}, {0, 1}}, groups = 0;
    solve(UNKNOWNS, 2, normal, inverse);
    for (count a = 0; a < g; a++)
        for (count b = 0; b < g; b++)
            sums[a][b][0] = sums[a][b][1] = sums[a][b][2] = 0;
    for (count a = 0; a < m; a++) {
        set_rows(m, a, places, grows, unknowns, fields, rows);
        for (count b = 0; b < m; b++) {
            double *sum = sums[within(cells[a], g)][within(cells[b], g)];
            double weight = weight_at(m, fields, a, b, ROBUST);
            for (int axis = 0; axis < 2; axis++)
                for (int u = 0; u < UNKNOWNS; u++)
                    sum[axis] += weight * fields[RESIDUAL][a][b] * rows[b][u] * inverse[u][axis];
            sum[2] += weight;
        }
    }
    for (count a = 0; a < g; a++)
        for (count b = 0; b < g; b++) {
            groups += sums[a][b][2] > 0;
            for (int i = 0; i < 2; i++)
                for (int j = 0; j < 2; j++)
                    covariance[i][j] += sums[a][b][i] * sums[a][b][j];
        }
    double freedom = squared(groups / greater(groups - UNKNOWNS, 1));
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            covariance[i][j] *= freedom;
}

static void projected(const double frame[3][3], double x, double y, double image[2])
{
    double scale = plane_at((double[]){frame[2][2], frame[2][0], frame[2][1]}, x, y);
    for (int row = 0; row < 2; row++)
        image[row] = (frame[row][0] * x + frame[row][1] * y + frame[row][2]) / scale;
}

/* Take changes from the plane of a frame before it is projected; see `changed` in vision/frame.py. */
static void change_frame(const double by[PLACE], double limit, double frame[3][3])
{
    double c[PLACE], product[3][3];
    for (int u = 0; u < PLACE; u++)
        c[u] = greater(lesser(-by[u], limit), -limit);
    double change[3][3] = {{1 + c[2], c[3], c[0]}, {c[4], 1 + c[5], c[1]}, {c[6], c[7], 1}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            product[i][j] = frame[i][0] * change[0][j] + frame[i][1] * change[1][j] +
                            frame[i][2] * change[2][j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            frame[i][j] = product[i][j] / product[2][2];
}

static void sample_values(count h, count w, count m, const float gray[h][w],
                          const double places[m], const double frame[3][3],
                          double fields[FIELDS][m][m])
{
    for (count a = 0; a < m; a++)
        for (count b = 0; b < m; b++) {
            fields[INSIDE][a][b] = fields[VALUE][a][b] = 0;
            if (!fields[KNOWN][a][b])
                continue;
            double at[2];
            projected(frame, places[b], places[a], at);
            fields[INSIDE][a][b] = at[0] >= 0 && at[1] >= 0 &&
                                   at[0] <= (double)(w - 1) && at[1] <= (double)(h - 1);
            fields[VALUE][a][b] = value_at(h, w, gray, at[0], at[1]);
        }
}

struct fit { /* of known samples */
    double alike;         /* share of those whose residuals are small */
    bool inside, printed; /* whether all are in the image, and darker where there is ink */
};

/* Set residuals, and relative ones, of which 1 leaves a quarter of the weight. */
static struct fit set_residuals(count m, const double places[m], bool grows,
                                const row_of_unknowns unknowns, double outlier, double normal,
                                double least, double agrees, double fields[FIELDS][m][m])
{
    count some = 0, small = 0;
    double low = HUGE_VAL, high = -HUGE_VAL, *sorted = fields[SORTED][0];
    struct fit fit = {.inside = true, .printed = true};
    for (count a = 0; a < m; a++)
        for (count b = 0; b < m; b++) {
            double value = fields[VALUE][a][b], x = places[b], y = places[a];
            double step = plane_at(unknowns + STEP, x, y);
            double shown = plane_at(unknowns + PAPER, x, y) + step * fields[INK][a][b];
            shown += grows ? unknowns[GROWTH] * slope_at(m, fields, a, b) : 0;
            fields[RESIDUAL][a][b] = value - shown;
            if (!fields[KNOWN][a][b])
                continue;
            sorted[some++] = fabs(value - shown);
            low = lesser(value, low), high = greater(value, high);
            fit.inside = fit.inside && fields[INSIDE][a][b];
            fit.printed = fit.printed && step < 0;
        }
    for (count j = 0; j < some; j++)
        small += sorted[j] < agrees * (high - low);
    fit.alike = (double)small / greater((double)some, 1);
    double usual = some ? normal * middle(some, sorted) : least;
    for (count a = 0; a < m; a++)
        for (count b = 0; b < m; b++)
            fields[RELATIVE][a][b] = fields[RESIDUAL][a][b] / (outlier * greater(usual, least));
    return fit;
}

void laid_prints(count h, count w, rows k, count n, count m, count g, const float gray[h][w],
                 const double start[k][3][3], const bool ink[k][n][n], const double places[m],
                 const int32_t cells[m], const double blurs[k][3], double inner,
                 double largest_step, double settled, double outlier, double normal_spread,
                 double least, double agrees, double hopeless, double ridge, int16_t rounds,
                 double frames[k][3][3], double unknowns[k][16], double shares[k],
                 double covariance[k][2][2], double fields[10][m][m], double share[3][n][m],
                 double samples[2][m][16], double sums[g][g][3])
{
    static const double square[4][2] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    bool grows = n > 1;
    for (count a = 0; a < m; a++)
        for (count b = 0; b < m; b++)
            fields[KNOWN][a][b] = greater(fabs(places[a]), fabs(places[b])) > inner;
    for (count i = 0; i < k; i++) {
        double *all = unknowns[i], blur = blurs[i][0];
        row_of_unknowns normal[UNKNOWNS], change;
        for (int u = 0; u < UNKNOWNS; u++)
            all[u] = 0;
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 3; column++)
                frames[i][row][column] = start[i][row][column];
        double corners[4][2];
        for (int corner = 0; corner < 4; corner++)
            projected(start[i], square[corner][0], square[corner][1], corners[corner]);
        for (int axis = 0; axis < 2; axis++)
            covariance[i][axis][0] = covariance[i][axis][1] = 0;
        shares[i] = 0;
        for (int round = 0; round < rounds; round++) {
            sample_values(h, w, m, gray, places, frames[i], fields);
            blur_print(n, m, ink[i], places, blur, share, fields);
            if (!round) { /* without steps, all rows but those of levels are 0 */
                normal_equations(m, places, grows, EQUAL, VALUE, PLACE, all, ridge, fields,
                                 samples, normal, change);
                double of_levels[PLACE][PLACE];
                for (int u = 0; u < PLACE; u++)
                    for (int v = 0; v < PLACE; v++)
                        of_levels[u][v] = normal[PLACE + u][PLACE + v];
                solve(PLACE, 1, of_levels, (double(*)[1])(change + PLACE));
                for (int u = PAPER; u < UNKNOWNS; u++)
                    all[u] = -change[u];
            }
            struct fit fit = set_residuals(m, places, grows, all, outlier, normal_spread, least,
                                           agrees, fields);
            normal_equations(m, places, grows, ROBUST, RESIDUAL, 0, all, ridge, fields, samples,
                             normal, change);
            solve(UNKNOWNS, 1, normal, (double(*)[1])change);
            change_frame(change, largest_step, frames[i]);
            double farthest = 0;
            for (int corner = 0; corner < 4; corner++) {
                double at[2];
                projected(frames[i], square[corner][0], square[corner][1], at);
                double x = at[0] - corners[corner][0], y = at[1] - corners[corner][1];
                farthest = greater(sqrt(x * x + y * y), farthest);
                corners[corner][0] = at[0], corners[corner][1] = at[1];
            }
            bool done = farthest < settled && fit.inside && fit.printed;
            if (done) {
                row_of_unknowns gained;
                normal_equations(m, places, grows, GAIN, RESIDUAL, 0, all, ridge, fields, samples,
                                 normal, gained);
                set_covariance(m, g, places, cells, grows, all, fields, samples[0], normal, sums,
                               covariance[i]);
                shares[i] = fit.alike;
            }
            blur = lesser(greater(blur - change[BLUR], blurs[i][1]), blurs[i][2]);
            for (int u = PAPER; u < UNKNOWNS; u++)
                all[u] -= change[u];
            if (done || (round && !(fit.alike > hopeless)))
                break;
        }
        all[BLUR] = blur;
    }
}
