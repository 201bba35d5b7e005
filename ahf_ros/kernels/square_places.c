/* Where square markers are, and which of several readings are in one place. */

#include "elementary.h"
#include "kernels.h"

/* Homographies from the square about the origin with sides of 1 to quadrilaterals, after Heckbert,
   Fundamentals of texture mapping and image warping, 1989, section 2.2.3. */
void square_frames(count k, const double corners[k][4][2], double frames[k][3][3])
{
    for (count i = 0; i < k; i++) {
        const double(*p)[2] = corners[i];
        double x = p[0][0] - p[1][0] + p[2][0] - p[3][0], y = p[0][1] - p[1][1] + p[2][1] - p[3][1];
        double one[2] = {p[1][0] - p[2][0], p[1][1] - p[2][1]};
        double other[2] = {p[3][0] - p[2][0], p[3][1] - p[2][1]};
        double turn = one[0] * other[1] - one[1] * other[0];
        double g = (x * other[1] - y * other[0]) / turn, h = (one[0] * y - one[1] * x) / turn;
        double middle = 1 + (g + h) / 2;
        for (int row = 0; row < 2; row++) {
            double a = p[1][row] - p[0][row] + g * p[1][row];
            double b = p[3][row] - p[0][row] + h * p[3][row];
            frames[i][row][0] = a / middle;
            frames[i][row][1] = b / middle;
            frames[i][row][2] = (p[0][row] + (a + b) / 2) / middle;
        }
        frames[i][2][0] = g / middle, frames[i][2][1] = h / middle, frames[i][2][2] = 1;
    }
}

static inline bool within_reach(const double one[2], const double other[2], double reach)
{
    double x = one[0] - other[0], y = one[1] - other[1];
    return x * x + y * y <= reach * reach;
}

/* Which places have one of n points within their reach. */
void taken_places(count k, count n, const double places[k][2], const double reach[k],
                  const double points[n][2], bool taken[k])
{
    for (count i = 0; i < k; i++) {
        taken[i] = false;
        for (count j = 0; j < n && !taken[i]; j++)
            taken[i] = within_reach(places[i], points[j], reach[i]);
    }
}

/* Which of k readings, the best first, own their place: no owner of the same kind is before them
   within the reach of either, and fewer than so many of any kind. */
void place_owners(count k, const double places[k][2], const double reach[k],
                  const int64_t kinds[k], int64_t most, bool owning[k])
{
    for (count i = 0; i < k; i++)
        owning[i] = true;
    for (count i = 0; i < k; i++) {
        owning[i] = owning[i] && most-- > 0;
        for (count j = i + 1; owning[i] && j < k; j++)
            if (kinds[i] == kinds[j] &&
                within_reach(places[i], places[j], greater(reach[i], reach[j])))
                owning[j] = false;
    }
}

/* The highest odds in the place of each reading: of other groups, or `none`, and of other numbers
   of its own, or `no_number`. */
void place_rivals(count k, const double places[k][2], const double reach[k],
                  const int64_t groups[k], const int64_t numbers[k], const double odds[k],
                  double none, double no_number, double of_groups[k], double of_numbers[k])
{
    for (count i = 0; i < k; i++) {
        of_groups[i] = none, of_numbers[i] = no_number;
        for (count j = 0; j < k; j++) {
            bool own = groups[i] == groups[j];
            if ((own && numbers[i] == numbers[j]) ||
                !within_reach(places[i], places[j], greater(reach[i], reach[j])))
                continue;
            double *highest = own ? of_numbers : of_groups;
            highest[i] = greater(highest[i], odds[j]);
        }
    }
}
