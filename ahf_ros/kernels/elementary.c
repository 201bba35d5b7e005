/* Elementary functions of arrays. */

#include "elementary.h"
#include "kernels.h"

void exponentials(count n, const double x[n], double y[n])
{
    for (count i = 0; i < n; i++)
        y[i] = exponential(x[i]);
}

void logarithms(count n, const double x[n], double y[n])
{
    for (count i = 0; i < n; i++)
        y[i] = logarithm(x[i]);
}

void normal_shares(count n, const double x[n], double y[n])
{
    for (count i = 0; i < n; i++)
        y[i] = normal_share(x[i]);
}

void exponentials_f(count n, const float x[n], float y[n])
{
    for (count i = 0; i < n; i++)
        y[i] = exponential_f(x[i]);
}

void logarithms_f(count n, const float x[n], float y[n])
{
    for (count i = 0; i < n; i++)
        y[i] = logarithm_f(x[i]);
}
