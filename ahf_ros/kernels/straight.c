/* Straight edges of an image, and the quadrilaterals that they enclose. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "elementary.h"
#include "kernels.h"

/* Sums over pixels of an edge, by their places beside the first one. */
struct sums {
    double n, x, y, xx, xy, yy;
};

static void add(struct sums *to, double x, double y)
{
    to->n += 1, to->x += x, to->y += y;
    to->xx += x * x, to->xy += x * y, to->yy += y * y;
}

/* Set the line through pixels: a point, and the direction that has what is bright on its left, where
   y points down. Return whether the pixels are near to it, by the root of their mean square. */
static bool set_line(const struct sums *of, double bright_x, double bright_y, double away,
                     double point[2], double along[2])
{
    double x = of->x / of->n, y = of->y / of->n;
    double xx = of->xx / of->n - x * x, xy = of->xy / of->n - x * y, yy = of->yy / of->n - y * y;
    double mean = (xx + yy) / 2, apart = sqrt((xx - yy) * (xx - yy) / 4 + xy * xy);
    double across = xx >= yy ? mean + apart - yy : xy, down = xx >= yy ? xy : mean + apart - xx;
    double length = sqrt(across * across + down * down);
    if (!(mean - apart < away * away) || !(length > 0))
        return false;
    if (down * bright_x - across * bright_y < 0)
        length = -length;
    point[0] = x, point[1] = y;
    along[0] = across / length, along[1] = down / length;
    return true;
}

/* Pixels to either side among which an edge goes on, and how far aside of it, px. */
enum { REACH = 2 };
#define ASIDE 1.5

/* How far from a pixel its gradient is largest, px along the axis that it is nearer to: where the
   parabola through three of its sizes is. */
static double steepest(count h, count w, const int16_t sizes[h][w], count row, count column,
                       bool level)
{
    count above = level && row ? row - 1 : row, below = level && row < h - 1 ? row + 1 : row;
    count left = !level && column ? column - 1 : column;
    count right = !level && column < w - 1 ? column + 1 : column;
    double here = abs(sizes[row][column]);
    double before = abs(sizes[above][left]), behind = abs(sizes[below][right]);
    double bent = 2 * here - before - behind, away = bent > 0 ? (behind - before) / (2 * bent) : 0;
    return greater(lesser(away, 0.5), -0.5);
}

/* Take the pixels side by side that have gradients like the mean of all, from a first one on; return
   how many these are, with their sums, and the sum of their directions. */
static count grown(count h, count w, count e, const int16_t across[h][w], const int16_t down[h][w],
                   double cosine, count first, uint8_t left[h][w], int32_t taken[e],
                   struct sums *of, double bright[2])
{
    count n = 0;
    left[first / w][first % w] = 0;
    taken[n++] = (int32_t)first;
    for (count next = 0; next < n; next++) {
        count x = taken[next] % w, y = taken[next] / w;
        double gx = across[y][x], gy = down[y][x], size = sqrt(gx * gx + gy * gy);
        bool level = fabs(gx) < fabs(gy);
        double away = steepest(h, w, level ? down : across, y, x, level);
        add(of, (double)(x - first % w) + (level ? 0 : away),
            (double)(y - first / w) + (level ? away : 0));
        bright[0] += size > 0 ? gx / size : 0;
        bright[1] += size > 0 ? gy / size : 0;
        double total = sqrt(bright[0] * bright[0] + bright[1] * bright[1]);
        for (count v = y > REACH ? y - REACH : 0; v <= y + REACH && v < h; v++)
            for (count u = x > REACH ? x - REACH : 0; u <= x + REACH && u < w; u++) {
                if (n >= e || !left[v][u])
                    continue;
                double a = across[v][u], d = down[v][u];
                double aside = (double)(u - x) * bright[0] + (double)(v - y) * bright[1];
                if (!(a * bright[0] + d * bright[1] >= cosine * total * sqrt(a * a + d * d)) ||
                    fabs(aside) > ASIDE * total)
                    continue;
                taken[n++] = (int32_t)(v * w + u);
                left[v][u] = 0;
            }
    }
    return n;
}

/* What is left are corners, curves and single pixels. */
void straight_edges(count h, count w, count m, count e, const uint8_t marked[h][w],
                    const int16_t across[h][w], const int16_t down[h][w], double cosine,
                    double strict, double least, double away, double edges[m][4], int64_t found[1],
                    int32_t taken[e], uint8_t left[h][w])
{
    count k = 0;
    memcpy(left, marked, sizeof(uint8_t[h][w]));
    for (count first = 0; first < h * w && k < m; first++) {
        count column = first % w, row = first / w;
        if (!left[row][column])
            continue;
        double point[2], along[2], low = HUGE_VAL, high = -HUGE_VAL;
        bool straight = false;
        count n = 0;
        for (int tries = 0; tries < 2 && !straight; tries++) {
            double bright[2] = {0, 0};
            struct sums of = {0};
            for (count i = 0; i < n; i++) /* two edges at a small angle: one of them */
                left[taken[i] / w][taken[i] % w] = 1;
            n = grown(h, w, e, across, down, tries ? strict : cosine, first, left, taken, &of,
                      bright);
            if ((double)n < least)
                break;
            straight = set_line(&of, bright[0], bright[1], away, point, along);
        }
        if (!straight)
            continue;
        for (count next = 0; next < n; next++) {
            double x = (double)(taken[next] % w - column), y = (double)(taken[next] / w - row);
            double at = (x - point[0]) * along[0] + (y - point[1]) * along[1];
            low = lesser(low, at), high = greater(high, at);
        }
        if (!(high - low >= least))
            continue;
        for (int end = 0; end < 2; end++) {
            double at = end ? high : low;
            edges[k][2 * end] = (double)column + point[0] + at * along[0];
            edges[k][2 * end + 1] = (double)row + point[1] + at * along[1];
        }
        k++;
    }
    found[0] = k;
    for (; k < m; k++)
        edges[k][0] = edges[k][1] = edges[k][2] = edges[k][3] = 0;
}

/* Sides from one corner to others, the nearest ones; and those that are tried for one corner. */
enum { MOST = 12, TRIED = 2048 };

/* An edge: its ends, its direction, and its length. */
struct edge {
    double from[2], to[2], along[2], length;
};

static struct edge edge_of(const double ends[4])
{
    double x = ends[2] - ends[0], y = ends[3] - ends[1], length = sqrt(x * x + y * y);
    double scale = length > 0 ? 1 / length : 0;
    return (struct edge){{ends[0], ends[1]}, {ends[2], ends[3]}, {x * scale, y * scale}, length};
}

static inline double crossed(const double a[2], double x, double y) { return a[0] * y - a[1] * x; }
static inline double along(const double a[2], double x, double y) { return a[0] * x + a[1] * y; }

/* The cell of a grid that a place is in, or the nearest one. */
static inline count cell_at(double place, double side, count n)
{
    double at = place / side;
    return !(at > 0) ? 0 : at < (double)n ? (count)at : n - 1;
}

/* What makes edges one side: cosine of their angle, and their distances from one line, px and as a
   share of that between them; the share of a side that they show; the shortest side, px. */
enum { STRAIGHT, OFFSET, BENT, SEEN, SMALLEST, RULES };

/* Whether an edge goes on beyond another one, at what distance, or else infinity: the first of its
   ends is given, and the last one. */
static double continued(const struct edge *one, const double first[2], const double last[2],
                        const double rules[RULES])
{
    double x = first[0] - one->to[0], y = first[1] - one->to[1];
    double to_x = last[0] - one->to[0], to_y = last[1] - one->to[1];
    double far = along(one->along, x, y), farther = along(one->along, to_x, to_y);
    double most = rules[OFFSET] + rules[BENT] * farther;
    bool same = far > -rules[OFFSET] && farther > far;
    same = same && fabs(crossed(one->along, x, y)) < rules[OFFSET] + rules[BENT] * far;
    return same && fabs(crossed(one->along, to_x, to_y)) < most ? far : HUGE_VAL;
}

/* Whether an edge ends where another one begins, which turns to the right, and where they meet. */
static bool meets(const struct edge *one, const struct edge *other, double gap, double gaps,
                  double overlap, double turn, double place[2])
{
    double sine = crossed(one->along, other->along[0], other->along[1]);
    if (!(sine > turn))
        return false;
    double x = other->from[0] - one->from[0], y = other->from[1] - one->from[1];
    double beyond = -crossed(other->along, x, y) / sine - one->length;
    double before = crossed(one->along, x, y) / sine;
    place[0] = one->to[0] + beyond * one->along[0];
    place[1] = one->to[1] + beyond * one->along[1];
    return beyond > -overlap && before > -overlap && beyond < gap + gaps * one->length &&
           before < gap + gaps * other->length;
}

/* Set the edges that go on where others end, and the corners where others begin. */
static count set_corners(count n, count tall, count wide, count c, const double edges[n][4],
                         double side, const double gaps[3], double overlap, double turn,
                         const double rules[RULES], const int64_t cells[tall][wide],
                         const int64_t next[n], int64_t follows[n], int64_t begin[n],
                         int64_t end[n], int64_t second[c], double places[c][2])
{
    count k = 0;
    for (count i = 0; i < n; i++) {
        struct edge one = edge_of(edges[i]);
        double nearest = gaps[2], opposed = HUGE_VAL;
        count top = cell_at(one.to[1] - gaps[2], side, tall);
        count bottom = cell_at(one.to[1] + gaps[2], side, tall);
        count first = cell_at(one.to[0] - gaps[2], side, wide);
        count last = cell_at(one.to[0] + gaps[2], side, wide);
        begin[i] = k, follows[i] = -1;
        for (count row = top; row <= bottom; row++)
            for (count column = first; column <= last; column++)
                for (int64_t j = cells[row][column]; j >= 0; j = next[j]) {
                    struct edge other = edge_of(edges[j]);
                    double cosine = along(one.along, other.along[0], other.along[1]);
                    if (cosine > rules[STRAIGHT]) {
                        double far = continued(&one, other.from, other.to, rules);
                        if (far < nearest && j != i)
                            nearest = far, follows[i] = j;
                    } else if (-cosine > rules[STRAIGHT]) {
                        opposed = lesser(opposed, continued(&one, other.to, other.from, rules));
                    } else if (k < c && meets(&one, &other, gaps[0], gaps[1], overlap, turn,
                                              places[k])) {
                        second[k++] = j;
                    }
                }
        end[i] = k;
        if (opposed < nearest) /* what is dark changes sides: it is none of a quadrilateral */
            follows[i] = -1;
    }
    return k;
}

/* Set the corners where sides end that begin at each, as ranges of links. */
static count set_sides(count n, count c, count l, const double edges[n][4],
                       const double rules[RULES], const int64_t follows[n],
                       const int64_t begin[n], const int64_t end[n], const int64_t second[c],
                       const double places[c][2], count corners, int64_t first_link[c],
                       int64_t last_link[c], int64_t links[l])
{
    count k = 0;
    for (count i = 0; i < corners; i++) {
        int64_t j = second[i];
        double shown = 0;
        struct edge first = edge_of(edges[j]);
        first_link[i] = k;
        for (count steps = 0; j >= 0 && steps < n && k < first_link[i] + MOST; steps++) {
            struct edge last = edge_of(edges[j]);
            shown += last.length;
            for (int64_t to = begin[j]; to < end[j] && k < first_link[i] + MOST && k < l; to++) {
                double x = places[to][0] - places[i][0], y = places[to][1] - places[i][1];
                double length = sqrt(x * x + y * y), most = rules[OFFSET] + rules[BENT] * length;
                if (length >= rules[SMALLEST] && shown >= rules[SEEN] * length &&
                    along(first.along, x, y) > 0 && along(last.along, x, y) > 0 &&
                    fabs(crossed(first.along, x, y)) < most &&
                    fabs(crossed(last.along, x, y)) < most)
                    links[k++] = to;
            }
            j = follows[j];
        }
        last_link[i] = k;
    }
    return k;
}

/* Whether no quadrilateral before the last one has its corners as near to those of that one. Lists of
   them begin in the cells of their first corners. */
static bool different(count last, count tall, count wide, const double corners[last + 1][4][2],
                      double apart, double side, int64_t cells[tall][wide], int64_t next[last + 1])
{
    const double(*own)[2] = corners[last];
    count row = cell_at(own[0][1], side, tall), column = cell_at(own[0][0], side, wide);
    for (count v = cell_at(own[0][1] - apart, side, tall);
         v <= cell_at(own[0][1] + apart, side, tall); v++)
        for (count u = cell_at(own[0][0] - apart, side, wide);
             u <= cell_at(own[0][0] + apart, side, wide); u++)
            for (int64_t i = cells[v][u]; i >= 0; i = next[i]) {
                double farthest = 0;
                for (int j = 0; j < 8; j++)
                    farthest =
                        greater(farthest, fabs(corners[i][j / 2][j % 2] - own[j / 2][j % 2]));
                if (farthest < apart)
                    return false;
            }
    next[last] = cells[row][column], cells[row][column] = last;
    return true;
}

static void clear(count tall, count wide, int64_t cells[tall][wide])
{
    for (count row = 0; row < tall; row++)
        for (count column = 0; column < wide; column++)
            cells[row][column] = -1;
}

/* Edges that go on, and corners, which are two edges each, lie near to the end of the first one. A
   side is what lies between two corners on edges of one line; four sides are a quadrilateral. */
void edge_quadrilaterals(count n, count tall, count wide, count c, count l, count q,
                         const double edges[n][4], double side, const double gaps[3],
                         double overlap, double turn, const double rules[5], double apart,
                         double corners[q][4][2], int64_t found[1], int64_t cells[tall][wide],
                         int64_t next[n], int64_t follows[n], int64_t begin[n], int64_t end[n],
                         int64_t second[c], double places[c][2], int64_t first_link[c],
                         int64_t last_link[c], int64_t links[l], int64_t next_one[q])
{
    count k = 0;
    clear(tall, wide, cells);
    for (count i = n - 1; i >= 0; i--) { /* lists of edges by the cells that they begin in */
        int64_t *cell = &cells[cell_at(edges[i][1], side, tall)][cell_at(edges[i][0], side, wide)];
        next[i] = *cell, *cell = i;
    }
    count known = set_corners(n, tall, wide, c, edges, side, gaps, overlap, turn, rules, cells,
                              next, follows, begin, end, second, places);
    count sides = set_sides(n, c, l, edges, rules, follows, begin, end, second, places, known,
                            first_link, last_link, links);
    clear(tall, wide, cells);
    for (int64_t one = 0; one < known && k < q; one++) {
        count tried = 0; /* corners with a higher number than the first one, so that each is once */
        for (int64_t a = first_link[one]; a < last_link[one]; a++)
            for (int64_t b = first_link[links[a]]; b < last_link[links[a]] && links[a] > one; b++)
                for (int64_t d = first_link[links[b]]; d < last_link[links[b]] && links[b] > one;
                     d++) {
                    if (tried++ >= TRIED || !(links[d] > one) || k >= q)
                        continue;
                    for (int64_t e = first_link[links[d]]; e < last_link[links[d]]; e++) {
                        if (links[e] != one || k >= q)
                            continue;
                        int64_t each[4] = {one, links[a], links[b], links[d]};
                        for (int corner = 0; corner < 4; corner++)
                            memcpy(corners[k][corner], places[each[corner]], sizeof(double[2]));
                        k += different(k, tall, wide, corners, apart, side, cells, next_one);
                    }
                }
    }
    found[0] = k;
    for (count i = known; i < c; i++)
        second[i] = first_link[i] = last_link[i] = 0, places[i][0] = places[i][1] = 0;
    for (count i = sides; i < l; i++)
        links[i] = 0;
    for (; k < q; k++) {
        memset(corners[k], 0, sizeof corners[k]);
        next_one[k] = 0;
    }
}
