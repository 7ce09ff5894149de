"""Numbers that whiteness tests of the lab are held against: statsmodels and scipy on a series that
both languages make with plain integer arithmetic. Needs numpy, scipy, statsmodels.
"""

import numpy as np
from scipy import stats
from statsmodels.stats.diagnostic import acorr_ljungbox


def uniform(n):
    state, values = 12345, []
    for _ in range(n):
        state = (1103515245 * state + 12345) % 2**31
        values.append(state / 2**31 - 0.5)
    return np.array(values)


for n, lags in [(500, 20), (60, 12)]:
    row = acorr_ljungbox(uniform(n), lags=[lags]).iloc[0]
    print(f"Ljung-Box n={n} lags={lags}: Q={row.lb_stat:.12f} p={row.lb_pvalue:.12f}")

for n in [500, 61]:
    x = uniform(n)
    power = np.abs(np.fft.fft(x - x.mean()))[1 : (n - 1) // 2 + 1] ** 2
    sums = np.cumsum(power)[:-1] / power.sum()
    test = stats.kstest(sums, "uniform", method="exact")
    print(f"Bartlett n={n}: D={test.statistic:.12f} p={test.pvalue:.12f}")

for df in [50.0, 3.5]:
    low, high = stats.chi2.ppf([0.025, 0.975], df)
    print(f"chi-square df={df}: RMS factor {np.sqrt(df / high):.9f} .. {np.sqrt(df / low):.9f}")
