/* Words and covers along bands: the dynamic programs of families/ring/decoding.py and
   codewords.py (Viterbi 1967). A band is a circle of m angles, which paths go round once from
   where it is seen best. */

#include "elementary.h"
#include "kernels.h"

static inline count around(int64_t i, count n) { return (count)((i % n + n) % n); }

static const float NEVER = -1e30f;

/* Readings of which none counts too much: sums over halves h of the band, bounded by a multiple of
   their weight, as light may do anything at any angle. For shares of ink between paper, the first,
   and ink, the last, they are the best ones within `reach` steps: the phase of sectors is known to
   no better. */
void bounded_readings(rows k, count h, count n, count m, const float values[k][h][n][m],
                      const float most[k], const int64_t reach[k], float best[k][n][m],
                      float bounded[n][m])
{
    for (count b = 0; b < k; b++) {
        for (count s = 0; s < n; s++) {
            for (count a = 0; a < m; a++)
                bounded[s][a] = 0;
            for (count half = 0; half < h; half++)
                for (count a = 0; a < m; a++)
                    bounded[s][a] += values[b][half][s][a];
            for (count a = 0; a < m; a++)
                bounded[s][a] = most[b] * hyperbolic_tangent_f(bounded[s][a] / most[b]);
        }
        for (count s = 0; s < n; s++) {
            int64_t away = s == 0 || s == n - 1 ? 0 : reach[b] < n - 2 ? reach[b] : n - 2;
            count low = within(s - away, n), high = within(s + away, n);
            for (count a = 0; a < m; a++)
                best[b][s][a] = bounded[s][a];
            for (count near = low; near <= high; near++)
                for (count a = 0; a < m; a++)
                    best[b][s][a] = greater_f(best[b][s][a], bounded[near][a]);
        }
    }
}

/* Evidence for a one over a zero in each of n sectors, and what a pair of ones adds, at p phases,
   from that for ink over paper: arcs spread beyond their sectors, by the shares of ink that they
   have at p angles before and after where they begin and where they end. */
void sector_evidence(count k, count m, count p, count n, const float inked[k][m],
                     const double rising[k][2][p], const double falling[k][2][p], double ones[k][p][n],
                     double pairs[k][p][n])
{
    for (count b = 0; b < k; b++)
        for (count phase = 0; phase < p; phase++)
            for (count sector = 0; sector < n; sector++) {
                double sum = 0, begins = 0, ends = 0, ends_here = 0;
                count before = around(phase + sector * p - p, m), here = around(before + p, m);
                for (count side = 0; side < 2; side++)
                    for (count i = 0; i < p; i++) {
                        begins += inked[b][before] * rising[b][side][i];
                        ends_here += inked[b][before] * falling[b][side][i];
                        ends += inked[b][here] * falling[b][side][i];
                        sum += side == 0 ? inked[b][here] : 0;
                        before = before + 1 < m ? before + 1 : 0;
                        here = here + 1 < m ? here + 1 : 0;
                    }
                ones[b][phase][sector] = sum + begins + ends;
                pairs[b][phase][sector] = -(begins + ends_here);
            }
}

/* The bits, of any word, with the most evidence, and that: once for each first bit. `zero` and
   `one` are whether the best path to either has a one before it. */
void likeliest_bits(count k, count n, const double ones[k][n], const double pairs[k][n],
                    bool bits[k][n], double highest[k], bool before[k][2][n][2])
{
    for (count b = 0; b < k; b++) {
        count best_first = 0, last = 0;
        for (count first = 0; first < 2; first++) {
            double zero = first ? -1e300 : 0.0, one = first ? ones[b][0] : -1e300;
            before[b][first][0][0] = before[b][first][0][1] = false;
            for (count i = 1; i < n; i++) {
                double joined = one + pairs[b][i];
                before[b][first][i][0] = one > zero;
                before[b][first][i][1] = joined > zero;
                double from_zero = greater(joined, zero) + ones[b][i];
                zero = greater(one, zero);
                one = from_zero;
            }
            one += first ? pairs[b][0] : 0.0;
            double best = one > zero ? one : zero;
            if (first == 0 || best > highest[b]) {
                highest[b] = best;
                best_first = first;
                last = one > zero;
            }
        }
        for (count i = n - 1; i >= 0; i--) {
            bits[b][i] = last;
            last = before[b][best_first][i][last];
        }
    }
}

/* Evidence of a word at four phases, by what each seven of its bits and the one before them say. */
enum { BITS = 7, PARTS = 9, PHASES = 4 };

static inline void evidence_of(int64_t word, count n, float sums[PARTS][2 << BITS][PHASES],
                               float scores[PHASES])
{
    uint64_t left = (uint64_t)word << 1 | (word >> within(n - 1, 63) & 1);
    for (int phase = 0; phase < PHASES; phase++)
        scores[phase] = 0;
    for (count part = 0; part < PARTS && left; part++, left >>= BITS)
        for (int phase = 0; phase < PHASES; phase++)
            scores[phase] += sums[part][left & ((2 << BITS) - 1)][phase];
}

/* The words with the most evidence at any of four phases, more than others before they are read by
   a prior, and the best phase of each: c of them, the best first, again where there are fewer. */
void competing_words(rows k, count n, count w, count c, const double ones[k][4][n],
                     const double pairs[k][4][n], const int64_t words[w], const float prior[w],
                     int64_t best[k][c], int64_t phases[k][c], float highest[c])
{
    float sums[PARTS][2 << BITS][PHASES] = {0}, scores[PHASES];
    for (count b = 0; b < k; b++) {
        for (count part = 0; part * BITS < n && part < PARTS; part++)
            for (count bit = 0; bit < BITS; bit++) {
                count i = within(part * BITS + bit, n), top = 2 << bit;
                for (count low = 0; low < top; low++)
                    for (int phase = 0; phase < PHASES; phase++) {
                        float one = (float)ones[b][phase][i], pair = (float)pairs[b][phase][i];
                        pair = low >> bit & 1 ? pair : 0;
                        sums[part][top + low][phase] = sums[part][low][phase] + one + pair;
                    }
            }
        count some = 0;
        for (count i = 0; i < w; i++) {
            evidence_of(words[i], n, sums, scores);
            float score = greater_f(greater_f(scores[0], scores[1]), greater_f(scores[2], scores[3]));
            score += prior[i];
            if (some == c && !(score > highest[c - 1]))
                continue;
            count place = some < c ? some++ : c - 1;
            for (; place > 0 && score > highest[place - 1]; place--) {
                highest[place] = highest[place - 1];
                best[b][place] = best[b][place - 1];
            }
            highest[place] = score;
            best[b][place] = words[i];
        }
        for (count place = 0; place < c; place++) {
            best[b][place] = best[b][place % some];
            evidence_of(best[b][place], n, sums, scores);
            phases[b][place] = 0;
            for (int phase = 1; phase < PHASES; phase++)
                if (scores[phase] > scores[phases[b][place]])
                    phases[b][place] = phase;
        }
    }
}

/* Shares of ink that w words show at each angle, in so many steps from paper to ink, by the angle
   at which their lowest bit begins. Each of n sectors has p angles; for the spread of their ends
   see `sector_evidence`. */
void word_steps(rows k, count w, count p, count n, count m, const int64_t words[k][w],
                const int64_t phases[k][w], const float rising[k][2][p], const float falling[k][2][p],
                int64_t last, uint8_t steps[k][w][m])
{
    for (count b = 0; b < k; b++)
        for (count word = 0; word < w; word++) {
            count a = around(phases[b][word], m);
            for (count sector = 0; sector < n; sector++) {
                bool before = words[b][word] >> (sector > 0 ? sector - 1 : n - 1) & 1;
                bool here = words[b][word] >> sector & 1;
                bool after = words[b][word] >> (sector + 1 < n ? sector + 1 : 0) & 1;
                for (count i = 0; i < p; i++) {
                    float share = here;
                    if (here != before)
                        share += here ? rising[b][1][i] : falling[b][1][i];
                    if (here != after)
                        share += after ? rising[b][0][i] : falling[b][0][i];
                    share = greater_f(lesser_f(share, 1), 0);
                    steps[b][word][a] = (uint8_t)(share * (float)within(last, 256) + 0.5f);
                    a = a + 1 < m ? a + 1 : 0;
                }
            }
        }
}

/* A band as a path meets it: what is at the angle that is so many after the first one. */
static inline count angle_after(int64_t first, count i, count m)
{
    count a = within(first, m) + i;
    return a < m ? a : a - m;
}

/* Evidence for words with their best covers, from that for what they show. A cover has its `price`
   and a `cost` at each angle, and an angle beside it counts for no more than `most`; one that looks
   like paper has its own price, and its evidence at each angle, on paper and on marks. */
void covered_words(rows k, count w, count n, count m, const float looks[k][n][m],
                   const uint8_t steps[k][w][m], const int64_t first[k],
                   const float as_paper[2][k][m], float price, const float cost[k],
                   const float paper_price[k], const float most[k][m], float scores[k][w])
{
    enum { TOGETHER = 8 }; /* words, whose paths do not wait for each other */
    for (count b = 0; b < k; b++)
        for (count start = 0; start < w; start += TOGETHER) {
            float clear[TOGETHER], beside[TOGETHER], covered[TOGETHER], like_paper[TOGETHER];
            float of_angle[TOGETHER], of_paper[TOGETHER];
            for (count j = 0; j < TOGETHER; j++) {
                clear[j] = 0;
                beside[j] = covered[j] = like_paper[j] = NEVER; /* no path begins under a cover */
            }
            for (count i = 0; i < m; i++) {
                count a = angle_after(first[b], i, m);
                for (count j = 0; j < TOGETHER; j++) {
                    count step = within(steps[b][within(start + j, w)][a], n);
                    of_angle[j] = looks[b][step][a];
                    of_paper[j] = as_paper[2 * step > n - 1][b][a];
                }
                for (count j = 0; j < TOGETHER; j++) {
                    float begun = i ? clear[j] - paper_price[b] : NEVER;
                    float seen = greater_f(clear[j], like_paper[j]);
                    like_paper[j] = greater_f(like_paper[j], begun) + of_paper[j];
                    begun = beside[j] - price; /* after the angle before */
                    float at_most = lesser_f(of_angle[j], most[b][a]);
                    beside[j] = greater_f(seen, covered[j]) + at_most;
                    clear[j] = greater_f(seen + of_angle[j], covered[j] + at_most);
                    covered[j] = greater_f(covered[j], begun) - cost[b];
                }
            }
            for (count j = 0; j < TOGETHER && start + j < w; j++)
                scores[b][start + j] = greater_f(greater_f(clear[j], covered[j]), like_paper[j]);
        }
}

/* Where the best path of one word of each band is covered: where the best one that is covered there
   has more evidence than the best one that is not. `until` is the evidence of the best paths to
   each angle on which the band is seen, covered, or covered by something like paper. */
void hidden_angles(count k, count n, count m, const float looks[k][n][m],
                   const uint8_t steps[k][m], const int64_t first[k],
                   const float as_paper[2][k][m], float price, const float cost[k],
                   const float paper_price[k], bool hidden[k][m], float until[k][m][3])
{
    for (count b = 0; b < k; b++) {
        float seen = 0, covered = NEVER, like_paper = NEVER;
        for (count i = 0; i < m; i++) {
            count a = angle_after(first[b], i, m), step = within(steps[b][a], n);
            float begun = i ? seen : NEVER;
            seen = greater_f(greater_f(seen, covered), like_paper) + looks[b][step][a];
            covered = greater_f(covered, begun - price) - cost[b];
            like_paper = greater_f(like_paper, begun - paper_price[b]);
            like_paper += as_paper[2 * step > n - 1][b][a];
            until[b][i][0] = seen;
            until[b][i][1] = covered;
            until[b][i][2] = like_paper;
        }
        float after_seen = 0, after_covered = 0, after_paper = 0; /* the best paths from there on */
        for (count i = m - 1; i >= 0; i--) {
            count a = angle_after(first[b], i, m), step = within(steps[b][a], n);
            hidden[b][a] = greater_f(until[b][i][1] + after_covered, until[b][i][2] + after_paper) >
                           until[b][i][0] + after_seen;
            seen = after_seen + looks[b][step][a];
            covered = after_covered - cost[b];
            like_paper = after_paper + as_paper[2 * step > n - 1][b][a];
            after_covered = greater_f(seen, covered);
            after_paper = greater_f(seen, like_paper);
            after_seen = greater_f(covered - price, like_paper - paper_price[b]);
            after_seen = greater_f(seen, after_seen);
        }
    }
}

/* Evidence for arcs of ink of any length, with their best covers, and the number of their borders,
   each of which has its price. */
void free_arcs(count k, count n, count m, const float looks[k][n][m], const int64_t first[k],
               const float border[k], float price, const float cost[k], float scores[k],
               int64_t borders[k])
{
    for (count b = 0; b < k; b++) {
        float seen[2] = {0, 0}, covered = NEVER; /* on paper or on ink; covered */
        int64_t of_seen[2] = {0, 0}, of_covered = 0;
        for (count i = 0; i < m; i++) {
            count a = angle_after(first[b], i, m);
            float here[2] = {looks[b][0][a], looks[b][n - 1][a]};
            float turned = greater_f(here[0], here[1]);
            for (count s = 1; s < n - 1; s++)
                turned = greater_f(turned, greater_f(looks[b][s][a], 0));
            turned -= border[b];
            float next[2], begun = i ? greater_f(seen[0], seen[1]) - price : NEVER;
            int64_t of_next[2];
            for (count side = 0; side < 2; side++) {
                float stayed = greater_f(seen[side], covered) + here[side];
                float from_other = seen[1 - side] + turned;
                bool turns = i && from_other > stayed;
                next[side] = turns ? from_other : stayed;
                of_next[side] = turns                  ? of_seen[1 - side] + 1
                                : covered > seen[side] ? of_covered
                                                       : of_seen[side];
            }
            if (begun > covered)
                of_covered = of_seen[seen[1] > seen[0]];
            covered = greater_f(covered, begun) - cost[b];
            for (count side = 0; side < 2; side++) {
                seen[side] = next[side];
                of_seen[side] = of_next[side];
            }
        }
        count best = seen[1] > seen[0];
        scores[b] = greater_f(seen[best], covered);
        borders[b] = covered > seen[best] ? of_covered : of_seen[best];
    }
}

/* Which of v moves of a word along the band has the most evidence, the first of them if several
   do. Each shows the mean step of two angles of the word at each angle. */
void best_moves(rows k, count n, count m, count v, const float looks[k][n][m],
                const uint8_t steps[k][m], const int64_t here[v][m], const int64_t before[v][m],
                int64_t best[k])
{
    for (count b = 0; b < k; b++) {
        float highest = 0;
        for (count move = 0; move < v; move++) {
            float sum = 0;
            for (count a = 0; a < m; a++) {
                int step = steps[b][within(here[move][a], m)] + steps[b][within(before[move][a], m)];
                sum += looks[b][within(step / 2, n)][a];
            }
            if (move == 0 || sum > highest) {
                highest = sum;
                best[b] = move;
            }
        }
    }
}

/* Where light is as predicted, from the best evidence of levels at each angle: light that nothing
   predicts comes in stretches, each of which has its price and another one for each angle. Paths
   go round twice. `bounded` is how much better than predicted light the best path before an angle
   is, at most its price and at least as much less. */
void predicted_angles(count k, count m, const float best[k][m], const float further[k], float price,
                      bool predicted[k][m], float bounded[k][m])
{
    for (count b = 0; b < k; b++) {
        float path = 0;
        for (count i = 1; i < 2 * m; i++) { /* ahead of angles */
            count a = i < m ? i : i - m;
            bounded[b][a] = lesser_f(greater_f(path, -price), 0);
            path = bounded[b][a] - best[b][a] - further[b];
        }
        path = -best[b][m - 1] - further[b];
        for (count i = 2 * m - 2; i >= 0; i--) { /* behind them */
            count a = i < m ? i : i - m;
            float behind = lesser_f(greater_f(path, 0), price);
            float gain = -best[b][a] - further[b];
            predicted[b][a] = bounded[b][a] + gain + behind <= 0;
            path = behind + gain;
        }
    }
}
