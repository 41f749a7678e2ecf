// SPDX-License-Identifier: Apache-2.0
#include "signal/gamma_quantile.h"

#include <algorithm>
#include <cmath>

namespace simsense {
namespace {

constexpr double largest_solved_shape = 1e4;

/// Regularised incomplete gamma functions of one side: lower P by its power series, upper Q by its continued fraction (Abramowitz and
/// Stegun 6.5.29 and 6.5.31), each where it converges fast. `density` is x times the density of x.
struct IncompleteGamma {
  double lower, upper, density;
};

double lower_series(double a, double x) {
  double term = 1, sum = 1;
  for (int n = 1; n < 20000 && term > 1e-17 * sum; ++n) sum += term *= x / (a + n);
  return sum / a;
}

/// Modified Lentz iteration.
double upper_fraction(double a, double x) {
  constexpr double tiny = 1e-300;
  double b = x + 1 - a, c = 1 / tiny, d = 1 / b, h = d;
  for (int n = 1; n < 20000; ++n) {
    const double numerator = -n * (n - a);
    b += 2;
    d = numerator * d + b;
    d = 1 / (std::abs(d) < tiny ? tiny : d);
    c = b + numerator / c;
    if (std::abs(c) < tiny) c = tiny;
    h *= d * c;
    if (std::abs(d * c - 1) < 1e-15) break;
  }
  return h;
}

IncompleteGamma incomplete_gamma(double a, double x) {
  const double density = std::exp(a * std::log(x) - x - std::lgamma(a));
  if (x < a + 1) {
    const double lower = density * lower_series(a, x);
    return {lower, 1 - lower, density};
  }
  const double upper = density * upper_fraction(a, x);
  return {1 - upper, upper, density};
}

double wilson_hilferty(double a, double z) {
  const double root = 1 - 1 / (9 * a) + z / (3 * std::sqrt(a));
  return a * root * root * root;
}

}  // namespace

double gamma_quantile(double a, double z) {
  double x = wilson_hilferty(a, z);
  if (a > largest_solved_shape) return x;
  const double lower = 0.5 * std::erfc(-z / std::sqrt(2.0)), upper = 0.5 * std::erfc(z / std::sqrt(2.0));
  const double small = (std::log(lower) + std::lgamma(a + 1)) / a;  // log of the quantile where x is small
  if (!(x > 0.02 * a) || a < 0.3) x = std::exp(std::clamp(small, -600.0, std::log(a + 20)));
  double y = std::log(x);
  for (int n = 0; n < 60; ++n) {  // Newton in log x on the log of the smaller tail
    const IncompleteGamma g = incomplete_gamma(a, std::exp(y));
    const double step = z < 0 ? std::log(g.lower / lower) * g.lower / g.density : -std::log(g.upper / upper) * g.upper / g.density;
    if (!std::isfinite(step)) break;
    y -= std::clamp(step, -1.0, 1.0);
    if (std::abs(step) < 1e-13) break;
  }
  return std::exp(y);
}

GammaTable::GammaTable(double shape, double scale) {
  const auto root = [&](int i) {
    const double z = z_min + (static_cast<double>(z_max) - z_min) * i / interval_count;
    return std::cbrt(scale * gamma_quantile(shape, z));
  };
  double start = root(0);
  for (int i = 0; i <= interval_count; ++i) {
    const double end = root(i + 1);
    intervals_.push_back({static_cast<float>(start), static_cast<float>(end - start)});
    start = end;
  }
}

}  // namespace simsense
