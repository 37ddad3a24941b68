#include "tools/import/svg_transform.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/strip.h"

namespace voxeld::voxelctl {
namespace {

std::optional<Matrix2> One(absl::string_view name, const std::vector<double>& n) {
  const auto turn = [](double degrees) { return degrees * std::numbers::pi / 180; };
  if (name == "matrix" && n.size() == 6) return Matrix2{n[0], n[1], n[2], n[3], n[4], n[5]};
  if (name == "translate" && (n.size() == 1 || n.size() == 2))
    return Matrix2{.e = n[0], .f = n.size() == 2 ? n[1] : 0};
  if (name == "scale" && (n.size() == 1 || n.size() == 2)) return Matrix2{.a = n[0], .d = n.back()};
  if (name == "rotate" && (n.size() == 1 || n.size() == 3)) {
    const double c = std::cos(turn(n[0])), s = std::sin(turn(n[0]));
    const double x = n.size() == 3 ? n[1] : 0, y = n.size() == 3 ? n[2] : 0;
    return Matrix2{.e = x, .f = y} * Matrix2{c, s, -s, c, 0, 0} * Matrix2{.e = -x, .f = -y};
  }
  if (name == "skewX" && n.size() == 1) return Matrix2{.c = std::tan(turn(n[0]))};
  if (name == "skewY" && n.size() == 1) return Matrix2{.b = std::tan(turn(n[0]))};
  return std::nullopt;
}

}  // namespace

std::optional<Matrix2> ParseSvgTransform(absl::string_view rest) {
  Matrix2 matrix;
  while (true) {
    while (!rest.empty() &&
           (rest[0] == ',' || absl::ascii_isspace(static_cast<unsigned char>(rest[0]))))
      rest.remove_prefix(1);
    if (rest.empty()) return matrix;
    const size_t open = rest.find('(');
    if (open == absl::string_view::npos) return std::nullopt;
    const absl::string_view name = absl::StripAsciiWhitespace(rest.substr(0, open));
    rest.remove_prefix(open + 1);
    std::vector<double> numbers;
    double number = 0;
    while (numbers.size() < 6 && TakeNumber(&rest, &number)) numbers.push_back(number);
    rest = absl::StripLeadingAsciiWhitespace(rest);
    const std::optional<Matrix2> one = One(name, numbers);
    if (!absl::ConsumePrefix(&rest, ")") || !one) return std::nullopt;
    matrix = matrix * *one;
  }
}

}  // namespace voxeld::voxelctl
