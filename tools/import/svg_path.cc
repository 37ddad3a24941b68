#include "tools/import/svg_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kPieces = 32;
constexpr double kArcStep = 5 * std::numbers::pi / 180;
constexpr double kLargestNumber = 1e12;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

class PathParser {
 public:
  PathParser(absl::string_view data, size_t most) : data_(data), rest_(data), most_(most) {}

  absl::StatusOr<std::vector<Polyline>> Parse() {
    char command = 0;
    while (true) {
      rest_ = absl::StripLeadingAsciiWhitespace(rest_);
      if (rest_.empty()) break;
      if (absl::ascii_isalpha(static_cast<unsigned char>(rest_.front()))) {
        command = rest_.front();
        rest_.remove_prefix(1);
        if (command == 'z' || command == 'Z') {
          Close();
          continue;
        }
      } else if (command == 'm' || command == 'M') {
        --command;  // moves that go on are lines
      }
      if (lines_.empty() && command != 'M' && command != 'm') return Wrong("M or m");
      if (absl::Status status = Step(command); !status.ok()) return status;
      if (points_ > most_) {
        return absl::ResourceExhaustedError(
            absl::StrCat("makes more than ", most_, " points; take a part of it"));
      }
    }
    return std::move(lines_);
  }

 private:
  absl::Status Wrong(absl::string_view expected) const {
    return absl::InvalidArgumentError(
        absl::StrCat("has \"", EscapeForTerminal(rest_.substr(0, 20)), "\" at character ",
                     data_.size() - rest_.size() + 1, "; ", expected, " is expected"));
  }

  void Close() {
    if (lines_.empty()) return;
    lines_.back().closed = true;
    at_ = lines_.back().points.front();
    fresh_ = true;
  }

  void Add(Point2 p) {
    // What follows a closed line begins another where that began.
    if (fresh_) lines_.push_back({.points = {at_}}), ++points_;
    fresh_ = false;
    lines_.back().points.push_back(p);
    ++points_;
    at_ = p;
  }

  bool Take(double* number) {
    return TakeNumber(&rest_, number) && std::abs(*number) <= kLargestNumber;
  }
  // In absolute coordinates.
  bool Take(bool relative, Point2* p) {
    if (!Take(&p->x) || !Take(&p->y)) return false;
    if (relative) *p = {p->x + at_.x, p->y + at_.y};
    return true;
  }
  // One digit, which others may follow without a gap.
  bool TakeFlag(bool* flag) {
    while (!rest_.empty() &&
           (rest_.front() == ',' || absl::ascii_isspace(static_cast<unsigned char>(rest_.front()))))
      rest_.remove_prefix(1);
    if (rest_.empty() || (rest_.front() != '0' && rest_.front() != '1')) return false;
    *flag = rest_.front() == '1';
    rest_.remove_prefix(1);
    return true;
  }

  absl::Status Step(char command) {
    const bool relative = absl::ascii_islower(static_cast<unsigned char>(command));
    const char kind = absl::ascii_toupper(static_cast<unsigned char>(command));
    const Point2 mirrored = {2 * at_.x - handle_.x, 2 * at_.y - handle_.y};
    const char before = std::exchange(last_, kind);
    Point2 a, b, to;
    switch (kind) {
      case 'M':
        if (!Take(relative, &to)) return Wrong("a number");
        lines_.push_back({.points = {to}});
        ++points_;
        fresh_ = false;
        at_ = to;
        break;
      case 'L':
        if (!Take(relative, &to)) return Wrong("a number");
        Add(to);
        break;
      case 'H':
        if (!Take(&to.x)) return Wrong("a number");
        Add({relative ? at_.x + to.x : to.x, at_.y});
        break;
      case 'V':
        if (!Take(&to.y)) return Wrong("a number");
        Add({at_.x, relative ? at_.y + to.y : to.y});
        break;
      case 'C':
      case 'S':
        a = kind == 'S' && (before == 'C' || before == 'S') ? mirrored : at_;
        if ((kind == 'C' && !Take(relative, &a)) || !Take(relative, &b) || !Take(relative, &to))
          return Wrong("a number");
        Cubic(a, b, to);
        handle_ = b;
        break;
      case 'Q':
      case 'T':
        a = kind == 'T' && (before == 'Q' || before == 'T') ? mirrored : at_;
        if ((kind == 'Q' && !Take(relative, &a)) || !Take(relative, &to)) return Wrong("a number");
        Cubic({at_.x + (a.x - at_.x) * 2 / 3, at_.y + (a.y - at_.y) * 2 / 3},
              {to.x + (a.x - to.x) * 2 / 3, to.y + (a.y - to.y) * 2 / 3}, to);
        handle_ = a;
        break;
      case 'A':
        return Arc(relative);
      default:
        return Wrong("one of the commands M, L, H, V, C, S, Q, T, A and Z");
    }
    return absl::OkStatus();
  }

  void Cubic(Point2 a, Point2 b, Point2 to) {
    std::vector<Point2> points;
    AddCubic(at_, a, b, to, &points);
    for (const Point2& p : points) Add(p);
  }

  // By the specification's appendix F.6.5: the middle from the ends.
  absl::Status Arc(bool relative) {
    double rx, ry, degrees;
    bool large, sweep;
    Point2 to;
    if (!Take(&rx) || !Take(&ry) || !Take(&degrees)) return Wrong("a number");
    if (!TakeFlag(&large) || !TakeFlag(&sweep)) return Wrong("0 or 1");
    if (!Take(relative, &to)) return Wrong("a number");
    rx = std::abs(rx), ry = std::abs(ry);
    if (rx == 0 || ry == 0 || (to.x == at_.x && to.y == at_.y)) {
      Add(to);
      return absl::OkStatus();
    }
    const double turn = degrees * std::numbers::pi / 180, c = std::cos(turn), s = std::sin(turn);
    const double dx = (at_.x - to.x) / 2, dy = (at_.y - to.y) / 2;
    const double x = c * dx + s * dy, y = c * dy - s * dx;
    const double reach = std::hypot(x / rx, y / ry);
    if (reach > 1) rx *= reach, ry *= reach;
    const double u = x / rx, v = y / ry, square = u * u + v * v;
    double root = std::sqrt(std::max(0.0, (1 - square) / square));
    if (large == sweep) root = -root;
    const double mx = root * v * rx, my = -root * u * ry;
    const Point2 middle = {c * mx - s * my + (at_.x + to.x) / 2,
                           s * mx + c * my + (at_.y + to.y) / 2};
    const double from = std::atan2((y - my) / ry, (x - mx) / rx);
    double along = std::atan2((-y - my) / ry, (-x - mx) / rx) - from;
    if (sweep && along < 0) along += 2 * std::numbers::pi;
    if (!sweep && along > 0) along -= 2 * std::numbers::pi;
    const int pieces = std::clamp(static_cast<int>(std::ceil(std::abs(along) / kArcStep)), 1, 73);
    for (int i = 1; i < pieces; ++i) {
      const double angle = from + along * i / pieces;
      const double ex = rx * std::cos(angle), ey = ry * std::sin(angle);
      Add({c * ex - s * ey + middle.x, s * ex + c * ey + middle.y});
    }
    Add(to);
    return absl::OkStatus();
  }

  const absl::string_view data_;
  absl::string_view rest_;
  const size_t most_;
  std::vector<Polyline> lines_;
  size_t points_ = 0;
  Point2 at_, handle_;
  bool fresh_ = false;
  char last_ = 0;
};

}  // namespace

bool TakeNumber(absl::string_view* text, double* number) {
  absl::string_view rest = *text;
  while (!rest.empty() &&
         (rest.front() == ',' || absl::ascii_isspace(static_cast<unsigned char>(rest.front()))))
    rest.remove_prefix(1);
  size_t end = 0;
  const auto at = [&rest](size_t i) { return i < rest.size() ? rest[i] : '\0'; };
  if (at(end) == '+' || at(end) == '-') ++end;
  const size_t begin = end;
  while (IsDigit(at(end))) ++end;
  if (at(end) == '.') ++end;
  while (IsDigit(at(end))) ++end;
  if (end == begin) return false;
  if (at(end) == 'e' || at(end) == 'E') {
    const size_t sign = at(end + 1) == '+' || at(end + 1) == '-' ? 2 : 1;
    if (IsDigit(at(end + sign))) {
      end += sign;
      while (IsDigit(at(end))) ++end;
    }
  }
  absl::string_view digits = rest.substr(0, end);
  if (digits.front() == '+') digits.remove_prefix(1);
  if (!absl::SimpleAtod(digits, number) || !std::isfinite(*number)) return false;
  rest.remove_prefix(end);
  *text = rest;
  return true;
}

void AddCubic(Point2 from, Point2 a, Point2 b, Point2 to, std::vector<Point2>* out) {
  for (int i = 1; i < kPieces; ++i) {
    const double t = static_cast<double>(i) / kPieces, r = 1 - t;
    const double w0 = r * r * r, w1 = 3 * r * r * t, w2 = 3 * r * t * t, w3 = t * t * t;
    out->push_back({w0 * from.x + w1 * a.x + w2 * b.x + w3 * to.x,
                    w0 * from.y + w1 * a.y + w2 * b.y + w3 * to.y});
  }
  out->push_back(to);
}

absl::StatusOr<std::vector<Polyline>> ParseSvgPath(absl::string_view data, size_t most) {
  return PathParser(data, most).Parse();
}

}  // namespace voxeld::voxelctl
