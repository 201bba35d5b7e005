/* Votes of edges for centres, counted in cells, and their peaks. */

#include <math.h>
#include <string.h>

#include "kernels.h"

enum { RUN = 16, AROUND = 10 }; /* cells that are looked at together, and to a side about one */

/* Votes of edges for the cells at steps along their directions: p polarities, with steps of their
   own, by d directions of the major axes of ellipses. An edge of an ellipse votes along the line
   from its point there to the centre, if it is a flat one. Coordinates are in cells. */
void count_votes(count n, count p, count s, count d, count tall, count wide, const double x[n],
                 const double y[n], const float unit_x[n], const float unit_y[n],
                 const float steps[p][s], const float cosines[d], const float sines[d],
                 float squared_aspect, float flat, uint16_t votes[p][d][tall][wide])
{
    memset(votes, 0, sizeof(uint16_t[p][d][tall][wide]));
    for (count j = 0; j < d; j++)
        for (count i = 0; i < n; i++) {
            float towards_x = unit_x[i], towards_y = unit_y[i];
            if (squared_aspect < 1) {
                float along = unit_x[i] * cosines[j] + unit_y[i] * sines[j];
                float across = unit_y[i] * cosines[j] - unit_x[i] * sines[j];
                if (!(fabsf(along) < flat))
                    continue;
                /* The point of the ellipse (u / 1)^2 + (v / aspect)^2 = 1 with this normal. */
                float scale = 1 / sqrtf(along * along + squared_aspect * across * across);
                along *= scale;
                across *= squared_aspect * scale;
                towards_x = along * cosines[j] - across * sines[j];
                towards_y = along * sines[j] + across * cosines[j];
            }
            for (count a = 0; a < p; a++)
                for (count b = 0; b < s; b++) {
                    double column = x[i] + steps[a][b] * towards_x;
                    double row = y[i] + steps[a][b] * towards_y;
                    if (column >= 0 && column < (double)wide && row >= 0 && row < (double)tall)
                        votes[a][j][(count)row][(count)column]++;
                }
        }
}

/* Votes of the cells of a square from one on; beyond all of them there are none. */
static inline void read_square(count rows, count wide, const uint16_t votes[rows][wide], count side,
                               count first_row, count first_column, float square[side][side])
{
    bool whole = first_row >= 0 && first_row + side <= rows && first_column >= 0 &&
                 first_column + side <= wide;
    for (count r = 0; r < side; r++)
        for (count c = 0; c < side; c++) {
            count row = first_row + r, column = first_column + c;
            bool inside = whole || (row >= 0 && row < rows && column >= 0 && column < wide);
            square[r][c] = inside ? votes[row][column] : 0;
        }
}

/* Votes in a cell and, with less weight, beside it. */
static inline float weighted(count side, const float votes[side][side], count row, count column)
{
    static const float weights[3] = {0.5f, 1.0f, 0.5f};
    float sum = 0;
    for (int down = -1; down <= 1; down++)
        for (int across = -1; across <= 1; across++)
            sum += weights[1 + down] * weights[1 + across] * votes[row + down][column + across];
    return sum;
}

/* Leave out the votes of blocks, three by three in the middle, that have few with three others. */
static inline void leave_whole(float enough, float votes[AROUND][AROUND], bool whole[3][3])
{
    float blocks[5][5];
    for (int r = 0; r < 5; r++)
        for (int c = 0; c < 5; c++)
            blocks[r][c] = votes[2 * r][2 * c] + votes[2 * r][2 * c + 1] +
                           votes[2 * r + 1][2 * c] + votes[2 * r + 1][2 * c + 1];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            whole[r][c] = false;
            for (int near = 0; near < 4; near++) {
                int above = r + near / 2, left = c + near % 2;
                whole[r][c] |= blocks[above][left] + blocks[above][left + 1] +
                                   blocks[above + 1][left] + blocks[above + 1][left + 1] >
                               enough;
            }
        }
    for (int r = 0; r < 6; r++)
        for (int c = 0; c < 6; c++)
            votes[2 + r][2 + c] *= whole[r / 2][c / 2];
}

/* Where the parabola through values at -1, 0 and 1 is highest, at most half a cell away. */
static inline float top(float before, float value, float after, float flat)
{
    float curvature = 2 * value - before - after;
    float shift = (after - before) / (2 * (curvature > flat ? curvature : flat));
    return shift < -0.5f ? -0.5f : shift > 0.5f ? 0.5f : shift;
}

/* Whether no value within reach of a cell, of ascending ones in rows of so many, is higher. */
static inline bool is_highest(count n, const int64_t cells[n], const float values[n], int64_t wide,
                              int64_t reach, count own)
{
    for (int64_t down = -reach; down <= reach; down++) {
        int64_t from = cells[own] + down * wide - reach, to = from + 2 * reach;
        count low = 0, high = n;
        while (low < high) {
            count middle = low + (high - low) / 2;
            if (cells[middle] < from)
                low = middle + 1;
            else
                high = middle;
        }
        for (; low < n && cells[low] <= to; low++)
            if (values[low] > values[own])
                return false;
    }
    return true;
}

void highest_cells(count n, const int64_t cells[n], const float values[n], int64_t wide,
                   int64_t reach, bool highest[n])
{
    for (count i = 0; i < n; i++)
        highest[i] = is_highest(n, cells, values, wide, reach, i);
}

/* The first cell of a row, from one on, with more votes than `own`; `wide` if there is none. */
static inline count next_above(count wide, const uint16_t votes[wide], count from, float own)
{
    for (; from + RUN <= wide; from += RUN) { /* most cells have none */
        uint16_t most = 0;
        for (count c = from; c < from + RUN; c++)
            most = votes[c] > most ? votes[c] : most;
        if (most > own)
            break;
    }
    while (from < wide && !(votes[from] > own))
        from++;
    return from;
}

/* Cells with more votes in them and beside them than needed, and none with more within reach,
   their votes, and where between cells their tops are. Cells in blocks that, with some neighbours,
   have few do not count. Of no more cells than `most`, the first ones, only some are highest. */
void vote_peaks(count rows, count wide, count most, const uint16_t votes[rows][wide], float own,
                float needed, float enough, float flat, int64_t reach, int64_t cells[most],
                float sums[most], float shift[2][most], bool highest[most])
{
    float beside[3][3], around[AROUND][AROUND];
    bool whole[3][3];
    count n = 0;
    for (count r = 0; r < rows; r++)
        for (count c = next_above(wide, votes[r], 0, own); c < wide;
             c = next_above(wide, votes[r], c + 1, own)) {
            if (n == most)
                break;
            read_square(rows, wide, votes, 3, r - 1, c - 1, beside);
            if (!(weighted(3, beside, 1, 1) > needed))
                continue;
            /* Its block with two to each side, and where the cell is among theirs. */
            count down = 4 + r % 2, right = 4 + c % 2;
            read_square(rows, wide, votes, AROUND, r - down, c - right, around);
            leave_whole(enough, around, whole);
            float near[5];
            for (int i = 0; i < 5; i++)
                near[i] = weighted(AROUND, around, down + (i == 4) - (i == 3),
                                   right + (i == 2) - (i == 1));
            if (!whole[1][1] || !(near[0] > needed))
                continue;
            cells[n] = r * wide + c;
            sums[n] = near[0];
            shift[0][n] = top(near[1], near[0], near[2], flat);
            shift[1][n] = top(near[3], near[0], near[4], flat);
            n++;
        }
    for (count i = 0; i < n; i++)
        highest[i] = is_highest(n, cells, sums, wide, reach, i);
    for (count i = n; i < most; i++)
        highest[i] = false;
}
