/* Which marker of a dictionary the cells of quadrilaterals show. */

#include <math.h>

#include "elementary.h"
#include "kernels.h"

enum { BITS = 8, VALUES = 256, TURNS = 4 };
#define ROUNDING 1e-3 /* of sums of evidence in single precision, at the most */

/* Logarithmic odds against either of two, from those against each. */
static double against_both(double a, double b)
{
    return lesser(a, b) - logarithm(1 + exponential(-fabs(a - b)));
}

/* Sums of evidence over the bits of all bytes; without its lowest bit, the sum of a byte is known. */
static void set_sums(count c, count b, const float paper[c], float sums[b][VALUES])
{
    for (count byte = 0; byte < b; byte++)
        for (int value = 0; value < VALUES; value++) {
            int lowest = 0;
            while (value && !(value >> lowest & 1))
                lowest++;
            count cell = byte * BITS + lowest;
            float own = cell < c ? paper[cell] : 0;
            sums[byte][value] = value ? sums[byte][value & (value - 1)] + own : 0;
        }
}

/* Logarithm of the sum of odds, of which logarithms are given. */
static double log_sum(count n, const float odds[n][TURNS])
{
    float most[TURNS], sum[TURNS] = {0};
    for (int turn = 0; turn < TURNS; turn++)
        most[turn] = -1e30f;
    for (count word = 0; word < n; word++)
        for (int turn = 0; turn < TURNS; turn++)
            most[turn] = greater_f(odds[word][turn], most[turn]);
    float highest = greater_f(greater_f(most[0], most[1]), greater_f(most[2], most[3]));
    for (count word = 0; word < n; word++)
        for (int turn = 0; turn < TURNS; turn++)
            sum[turn] += exponential_f(odds[word][turn] - highest);
    return highest + logarithm((double)sum[0] + sum[1] + sum[2] + sum[3]);
}

void likeliest_words(rows k, count c, count b, count w, const float paper[k][c],
                     const double ink[k], const double square[k], const bool anyway[k],
                     const uint8_t words[b][w][4], const float prior[w], const double few[w],
                     const double shapes[w], double doubt, double figures, double possible,
                     int64_t best[k][2], double total[k], double others[k], bool likely[k],
                     float sums[b][256], float odds[w][4])
{
    float least_prior = INFINITY;
    double least_few = INFINITY;
    for (count word = 0; word < w; word++) {
        least_prior = lesser_f(prior[word], least_prior);
        least_few = lesser(few[word], least_few);
    }
    for (count i = 0; i < k; i++) {
        double bound = ink[i] - doubt - least_prior - least_few + ROUNDING;
        for (count cell = 0; cell < c; cell++)
            bound += greater_f(paper[i][cell], 0);
        if (!anyway[i] && !(bound > possible)) { /* of a word that has paper where it is likely */
            best[i][0] = best[i][1] = 0;
            total[i] = bound;
            others[i] = 0;
            likely[i] = false;
            continue;
        }
        set_sums(c, b, paper[i], sums);
        for (count word = 0; word < w; word++)
            for (int turn = 0; turn < TURNS; turn++)
                odds[word][turn] = -prior[word];
        for (count byte = 0; byte < b; byte++)
            for (count word = 0; word < w; word++)
                for (int turn = 0; turn < TURNS; turn++)
                    odds[word][turn] += sums[byte][words[byte][word][turn]];
        count first = 0, turned = 0;
        for (count word = 0; word < w; word++)
            for (int turn = 0; turn < TURNS; turn++)
                if (odds[word][turn] > odds[first][turned])
                    first = word, turned = turn;
        double most = odds[first][turned];
        best[i][0] = first, best[i][1] = turned;
        total[i] = against_both(most + ink[i] - doubt - few[first],
                                square[i] + shapes[first] - figures);
        likely[i] = total[i] > possible || anyway[i];
        for (int turn = 0; turn < TURNS; turn++)
            odds[first][turn] = -1e30f; /* a turn of the same marker is no other */
        others[i] = likely[i] ? log_sum(w, odds) - most : 0;
    }
}
