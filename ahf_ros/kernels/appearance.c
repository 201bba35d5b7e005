/* Whether targets in polar images look like the print of their words. */

#include <math.h>
#include <stdlib.h>

#include "elementary.h"
#include "kernels.h"

enum { BEYOND, GAP, DEEP, NEAR, KINDS }; /* ground, paper, a band, and that with its edges */

/* Whether a word of n sectors has a mark at an angle from where its lowest bit begins, if its ends
   are longer by some angles, or shorter. */
static bool marked(int64_t word, count n, count m, count angle, int64_t longer)
{
    count p = m > n ? m / n : 1, reach = longer > m ? m : longer < -m ? m : llabs(longer);
    for (count a = angle + m - reach; a <= angle + m + reach; a++)
        if ((word >> within(a % m / p, n < 63 ? n : 63) & 1) == (longer > 0))
            return longer > 0;
    return longer <= 0;
}

/* Differences of ln from light, a plane, on one circle, in steps of ink. */
static void steps_on(count m, const float gray[m], const double light[3], double step,
                     double radius, const double directions[2][m], double offset, float steps[m])
{
    for (count a = 0; a < m; a++) {
        double plane = light[1] * directions[0][a] + light[2] * directions[1][a];
        float of_paper = (float)(light[0] + radius * plane);
        steps[a] = (logarithm_f(gray[a] + (float)offset) - of_paper) / (float)step;
    }
}

/* The shares of n sectors in which targets differ from what their words print, at the radius with
   most, or of the marks that are lost; NaN where light is uneven. It is even where few readings of
   the ground differ from it and the dot is ink. `kinds` are bounds of radii. What is inked even if
   ends are shorter, or unmarked even if they are longer, is told. Two readings in one direction are
   no noise. */
void unlike_shares(count k, count i, count c, count m, count n, const float gray[i][c][m],
                   const int64_t row[k], const double light[k][3], const double step[k],
                   const double radii[c], const bool clear[c], const double reach[k][m],
                   const double directions[2][m], const int64_t words[k], const int64_t phases[k],
                   const int64_t longer[2][k], const double kinds[k][4][2], double offset,
                   double even, double uneven, double inmost, double deeper, double unlike,
                   int64_t readings, double of_marks, double shares[k], float steps[c][m],
                   bool told[3][m], bool odd[2][m], int64_t counts[2][m], double most[n])
{
    bool *inked = told[0], *unmarked = told[1], *known = told[2];
    int64_t *printed = counts[0], *missing = counts[1];
    count p = m > n ? m / n : 1;
    for (count b = 0; b < k; b++) {
        const float(*image)[m] = gray[within(row[b], i)];
        count phase = within((phases[b] % m + m) % m, m);
        double scale = step[b] == 0 ? HUGE_VAL : step[b], of_dot = 0, sum = 0;
        count ground = 0, unlike_ground = 0, of_inmost = 0, marks = 0, lost = 0;
        for (count j = 0; j < c; j++) {
            bool beyond = clear[j] && radii[j] > kinds[b][BEYOND][0] && radii[j] < kinds[b][BEYOND][1];
            if (beyond || radii[j] < inmost)
                steps_on(m, image[j], light[b], scale, radii[j], directions, offset, steps[j]);
            for (count a = 0; a < m && beyond; a++) {
                ground += radii[j] <= reach[b][a];
                unlike_ground += radii[j] <= reach[b][a] && fabsf(steps[j][a]) > even;
            }
            for (count a = 0; a < m && radii[j] < inmost; a++, of_inmost++)
                of_dot += steps[j][a];
        }
        of_dot /= (double)(of_inmost ? of_inmost : 1);
        shares[b] = NAN;
        if (!((double)unlike_ground < uneven * (double)ground && of_dot > 1 - even &&
              of_dot < deeper))
            continue;
        for (count a = 0; a < m; a++) {
            inked[a] = marked(words[b], n, m, a, longer[0][b]);
            unmarked[a] = !marked(words[b], n, m, a, longer[1][b]);
            known[a] = inked[a] || unmarked[a];
            odd[0][a] = false;
            printed[a] = missing[a] = 0;
        }
        for (count s = 0; s < n; s++)
            most[s] = 0;
        /* From here on, angles are those from the phase on. */
        for (count j = 0; j < c; j++) {
            bool is[KINDS], *before = odd[j % 2], *here = odd[1 - j % 2];
            for (int kind = 0; kind < KINDS; kind++)
                is[kind] = clear[j] && radii[j] > kinds[b][kind][0] && radii[j] < kinds[b][kind][1];
            if (!is[BEYOND] && !is[GAP] && !is[NEAR]) {
                for (count a = 0; a < m; a++)
                    here[a] = false;
                continue;
            }
            steps_on(m, image[j], light[b], scale, radii[j], directions, offset, steps[j]);
            for (count a = 0; a < m; a++) {
                count angle = phase + a < m ? phase + a : phase + a - m;
                bool seen = radii[j] <= reach[b][angle], ink = seen && inked[a] && is[DEEP];
                bool paper = seen && (is[GAP] || is[BEYOND] || (unmarked[a] && is[NEAR]));
                bool faded = ink && steps[j][angle] < unlike;
                printed[a] += ink;
                missing[a] += faded;
                here[a] = faded || (paper && steps[j][angle] > even);
            }
            for (count s = 0; s < n; s++) {
                count differ = 0, all = 0;
                for (count a = s * p; a < (s + 1) * p && a < m; a++) {
                    all += known[a];
                    differ += known[a] && here[a] && (j == 0 || before[a]);
                }
                most[s] = greater(most[s], (double)differ / (double)(all ? all : 1));
            }
        }
        for (count s = 0; s < n; s++)
            sum += most[s] / (double)n;
        for (count a = 0; a < m; a++) {
            marks += printed[a] > 0;
            lost += missing[a] >= readings;
        }
        shares[b] = greater(sum, of_marks * (double)lost / (double)(marks ? marks : 1));
    }
}
