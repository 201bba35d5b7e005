/* Homographies, by weighted least squares whose equations are divided by the depth of a point. */

#include <math.h>
#include <string.h>

#include "elementary.h"
#include "kernels.h"
#include "robust.h"

/* Unknowns are the elements of a homography row by row, but for the last one, which is 1. */
enum { UNKNOWNS = 8, CENTRE_X = 2, CENTRE_Y = 5, DEPTH = 6 };

/* The weighted middle of images, and their distance from there, root mean square. */
static double spread_of(count m, const double images[m][2], const double weights[m][2][2],
                        double middle[2])
{
    double total = 0, squares = 0;
    middle[0] = middle[1] = 0;
    for (count j = 0; j < m; j++) {
        double weight = weights[j][0][0] + weights[j][1][1];
        total += weight;
        for (int axis = 0; axis < 2; axis++)
            middle[axis] += weight * images[j][axis];
    }
    total = greater(total, 1e-30);
    for (int axis = 0; axis < 2; axis++)
        middle[axis] /= total;
    for (count j = 0; j < m; j++)
        squares += (weights[j][0][0] + weights[j][1][1]) *
                   (squared(images[j][0] - middle[0]) + squared(images[j][1] - middle[1]));
    return greater(sqrt(squares / total), 1e-6);
}

/* Add the equations of a point whose image is at a depth, to the upper triangle of normal ones. */
static void add_point(const double point[2], const double image[2], const double weights[2][2],
                      double depth, double normal[UNKNOWNS][UNKNOWNS], double right[UNKNOWNS])
{
    double rows[2][UNKNOWNS] = {{0}};
    for (int axis = 0; axis < 2; axis++) {
        double *row = rows[axis], *own = row + 3 * axis, seen = image[axis] / depth;
        own[0] = point[0] / depth, own[1] = point[1] / depth, own[2] = 1 / depth;
        row[DEPTH] = -seen * point[0], row[DEPTH + 1] = -seen * point[1];
    }
    for (int a = 0; a < UNKNOWNS; a++)
        for (int axis = 0; axis < 2; axis++) {
            double weighted = weights[axis][0] * rows[0][a] + weights[axis][1] * rows[1][a];
            right[a] += weighted * image[axis] / depth;
            for (int b = a; b < UNKNOWNS; b++)
                normal[a][b] += weighted * rows[axis][b];
        }
}

void fitted_homographies(rows k, count m, const double points[k][m][2],
                         const double images[k][m][2], const double weights[k][m][2][2],
                         double reach, double weak, double perspective, double least_depth,
                         int16_t rounds, double homographies[k][3][3], double covariance[k][2][2])
{
    for (count i = 0; i < k; i++) {
        double middle[2], size = spread_of(m, images[i], weights[i], middle);
        double normal[UNKNOWNS][UNKNOWNS], solved[UNKNOWNS][UNKNOWNS], found[UNKNOWNS] = {0};
        for (int round = 0; round < rounds; round++) {
            double right[UNKNOWNS] = {0};
            for (int a = 0; a < UNKNOWNS; a++)
                for (int b = 0; b < UNKNOWNS; b++)
                    normal[a][b] = a != b ? 0 : a < DEPTH ? weak : perspective;
            for (count j = 0; j < m; j++) {
                double point[2], image[2], weight[2][2], depth = 1;
                for (int axis = 0; axis < 2; axis++) {
                    point[axis] = points[i][j][axis] / reach;
                    image[axis] = (images[i][j][axis] - middle[axis]) / size;
                    depth += found[DEPTH + axis] * point[axis];
                    for (int other = 0; other < 2; other++)
                        weight[axis][other] = weights[i][j][axis][other] * size * size;
                }
                add_point(point, image, weight, greater(depth, least_depth), normal, right);
            }
            mirror(UNKNOWNS, normal);
            memcpy(solved, normal, sizeof solved);
            memcpy(found, right, sizeof found);
            solve(UNKNOWNS, 1, solved, (double(*)[1])found);
        }
        double inverse[UNKNOWNS][2] = {[CENTRE_X] = {1, 0}, [CENTRE_Y] = {0, 1}};
        solve(UNKNOWNS, 2, normal, inverse);
        for (int axis = 0; axis < 2; axis++) {
            covariance[i][0][axis] = inverse[CENTRE_X][axis] * size * size;
            covariance[i][1][axis] = inverse[CENTRE_Y][axis] * size * size;
        }
        for (int column = 0; column < 3; column++) {
            double unit = column < 2 ? reach : 1;
            double scale = column < 2 ? found[DEPTH + column] / unit : 1;
            for (int axis = 0; axis < 2; axis++)
                homographies[i][axis][column] =
                    size * found[3 * axis + column] / unit + middle[axis] * scale;
            homographies[i][2][column] = scale;
        }
    }
}
