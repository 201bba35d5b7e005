/* Polar images: gray values on circles about targets, and what they show. */

#include <math.h>

#include "elementary.h"
#include "images.h"
#include "kernels.h"
#include "robust.h"

/* Gray values of an image between pixels, in a range that begins at `lift` instead of at 0, at m
   directions on r circles about k targets, the innermost first; beyond the border the nearest pixel
   counts. The image shows all of a target, or a direction of it up to a radius. */
void circle_values(count h, count w, rows k, count r, count m, const float image[h][w],
                   const double frames[k][3][3], const double directions[2][m],
                   const double radii[k][r], const float lift[k], float values[k][r][m],
                   double reach[k][m])
{
    places at;
    float along[3][POINTS], centre[3], until[POINTS];
    for (count b = 0; b < k; b++) {
        float range = 1 - lift[b] / 255;
        for (count start = 0; start < m; start += POINTS) {
            count n = m - start < POINTS ? m - start : POINTS;
            project(n, frames[b], &directions[0][start], &directions[1][start], along, centre);
            for (count a = 0; a < n; a++)
                until[a] = HUGE_VALF;
            for (count j = 0; j < r; j++) {
                float before = j > 0 ? (float)radii[b][j - 1] : 0;
                place(h, w, n, along, centre, (float)radii[b][j], &at);
                for (count a = 0; a < n; a++)
                    values[b][j][start + a] =
                        lift[b] + range * greater_f(value_of(h, w, image, &at, a), 0);
                for (count a = 0; a < n; a++)
                    until[a] = at.outside[a] == 0 ? until[a] : lesser_f(until[a], before);
            }
            for (count a = 0; a < n; a++)
                reach[b][start + a] = until[a];
        }
    }
}

/* The same of an image of whole numbers, in units of its own, and whether it shows all of them. */
void short_values(count h, count w, rows k, count r, count m, const int16_t image[h][w],
                  const double frames[k][3][3], const double directions[2][m],
                  const double radii[k][r], double unit, double values[k][m][r], bool inside[k])
{
    places at;
    float along[3][POINTS], centre[3], seen[POINTS];
    for (count b = 0; b < k; b++) {
        inside[b] = true;
        for (count start = 0; start < m; start += POINTS) {
            count n = m - start < POINTS ? m - start : POINTS;
            project(n, frames[b], &directions[0][start], &directions[1][start], along, centre);
            for (count j = 0; j < r; j++) {
                place(h, w, n, along, centre, (float)radii[b][j], &at);
                shorts_of(h, w, image, &at, n, seen);
                for (count a = 0; a < n; a++) {
                    values[b][start + a][j] = seen[a] / unit;
                    inside[b] &= at.outside[a] == 0;
                }
            }
        }
    }
}

/* The median size, at m points of targets, of the second difference of rows of the second difference
   of columns; 0 in images that have none. */
void second_differences(count h, count w, rows k, count m, const float image[h][w],
                        const double frames[k][3][3], const double points[2][m], double medians[k],
                        double scratch[m])
{
    static const float second[3] = {1, -2, 1};
    places at;
    float along[3][POINTS], centre[3];
    for (count b = 0; b < k; b++) {
        medians[b] = 0;
        if (h < 3 || w < 3)
            continue;
        for (count start = 0; start < m; start += POINTS) {
            count n = m - start < POINTS ? m - start : POINTS;
            project(n, frames[b], &points[0][start], &points[1][start], along, centre);
            place(h, w, n, along, centre, 1, &at);
            for (count a = 0; a < n; a++) {
                count top = within(at.top[a] + (at.down[a] > 0.5f) - 1, h - 2);
                count left = within(at.left[a] + (at.across[a] > 0.5f) - 1, w - 2);
                float sum = 0;
                for (int down = 0; down < 3; down++)
                    for (int across = 0; across < 3; across++)
                        sum += second[down] * second[across] * image[top + down][left + across];
                scratch[start + a] = fabsf(sum);
            }
        }
        medians[b] = middle(m, scratch);
    }
}

/* Votes for s outlines of dark ground about bright targets: at each angle, one for each circle
   beyond the outline that is brighter than `white`, less one for each that is darker. Circles
   nearer than `least` do not vote. `beyond` is the number of circles beyond an outline at an angle.
   Where the outermost circle is not brighter, which its votes tell, there are none for outlines. */
void ground_votes(rows k, count i, count c, count m, count s, const float gray[i][c][m],
                  const int64_t row[k], const float white[k][m], const double radii[k][c],
                  const double least[k], const int64_t beyond[s][m], int64_t votes[k][s],
                  int64_t outermost[k], int32_t sums[c][m])
{
    for (count b = 0; b < k; b++) {
        const float(*image)[m] = gray[within(row[b], i)];
        for (count j = 0; j < c; j++) { /* from the outermost circle inwards */
            count circle = c - 1 - j;
            int32_t counts = radii[b][circle] >= least[b];
            const float *here = image[circle], *bound = white[b];
            for (count a = 0; a < m; a++) {
                int32_t vote = (here[a] > bound[a]) - (here[a] < bound[a]);
                sums[j][a] = (j > 0 ? sums[j - 1][a] : 0) + counts * vote;
            }
        }
        outermost[b] = 0;
        for (count a = 0; a < m; a++)
            outermost[b] += sums[0][a];
        for (count shape = 0; shape < s; shape++) {
            int64_t sum = 0;
            for (count a = 0; a < m && outermost[b] > 0; a++)
                if (beyond[shape][a] > 0)
                    sum += sums[within(beyond[shape][a] - 1, c)][a];
            votes[b][shape] = sum;
        }
    }
}
