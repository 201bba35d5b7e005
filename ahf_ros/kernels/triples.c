/* Triples of dots that three template dots may have been printed as. */

#include <math.h>

#include "elementary.h"
#include "kernels.h"
#include "robust.h"

typedef const double map[2][2];

static inline double determinant(map a) { return a[0][0] * a[1][1] - a[0][1] * a[1][0]; }

static inline void multiply(map a, map b, double product[2][2])
{
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            product[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j];
}

/* Logarithms of the semi-axes of the ellipse to which a map takes the unit circle. */
static inline void set_axes(map a, double axes[2])
{
    double sum = 0, area = determinant(a);
    for (int i = 0; i < 2; i++)
        sum += squared(a[i][0]) + squared(a[i][1]);
    double half = sqrt(greater(squared(sum / 2) - area * area, 0));
    axes[0] = logarithm(greater(sum / 2 + half, 1e-9)) / 2;
    axes[1] = logarithm(greater(sum / 2 - half, 1e-9)) / 2;
}

/* Whether three dots have the ellipses that a map of the print implies, all of them as much larger
   or smaller. */
static bool borne_out(count d, map affine, const int64_t dots[3], const double inverses[d][2][2],
                      const double allowed[d], const double printed[3], const double scales[2])
{
    double axes[3][2], sizes[3];
    for (int i = 0; i < 3; i++) {
        double relative[2][2];
        multiply(inverses[dots[i]], affine, relative);
        for (int j = 0; j < 4; j++)
            relative[j / 2][j % 2] *= printed[i];
        set_axes(relative, axes[i]);
        sizes[i] = (axes[i][0] + axes[i][1]) / 2;
    }
    double scale = -middle(3, sizes), own = allowed[dots[0]];
    bool good = scale > scales[0] - own && scale < scales[1] + own;
    for (int i = 0; i < 3; i++)
        good &= axes[i][0] + scale < allowed[dots[i]] && axes[i][1] + scale > -allowed[dots[i]];
    return good;
}

void likely_triples(count n, count d, count k, count most, const int64_t ends[n][2],
                    const double offsets[n][2], const double maps[d][2][2],
                    const double inverses[d][2][2], const double allowed[d], const double turn[2],
                    const double basis[2][2], const double printed[3], const double error[2],
                    const double scales[2], const int64_t partners[k], const int64_t begin[k],
                    const int64_t end[k], int64_t triples[most][3],
                    double affine[most][2][2], int64_t found[1])
{
    count number = 0;
    for (count i = 0; i < k; i++) {
        const double *partner = offsets[within(partners[i], n)];
        double x = partner[0] * turn[0] - partner[1] * turn[1];
        double y = partner[0] * turn[1] + partner[1] * turn[0];
        double reach = error[0] * sqrt(x * x + y * y) + error[1];
        for (int64_t other = begin[i] < 0 ? 0 : begin[i]; other < end[i] && other < n; other++) {
            const double *third = offsets[other];
            if (!(squared(third[0] - x) + squared(third[1] - y) < reach * reach) || number == most)
                continue;
            double images[2][2] = {{partner[0], third[0]}, {partner[1], third[1]}};
            const int64_t *own = ends[within(partners[i], n)];
            int64_t dots[3] = {within(own[0], d), within(own[1], d), within(ends[other][1], d)};
            double printed_map[2][2], *of = affine[number][0];
            multiply(images, basis, printed_map);
            multiply(maps[dots[0]], printed_map, affine[number]);
            if (!(of[0] * of[3] < of[1] * of[2]) || /* y is up, then down */
                !borne_out(d, affine[number], dots, inverses, allowed, printed, scales))
                continue;
            for (int j = 0; j < 3; j++)
                triples[number][j] = dots[j];
            number++;
        }
    }
    found[0] = number;
}
