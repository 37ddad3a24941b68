#include "tools/import/svg_contents.h"

#include <gdk-pixbuf/gdk-pixbuf.h>
#include <libxml/SAX2.h>
#include <libxml/parser.h>
#include <libxml/tree.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <memory>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "absl/container/flat_hash_set.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/nesting.h"

namespace voxeld::voxelctl {
namespace {

// librsvg draws recursively: 8 MiB of stack suffice for about 1200 nested elements.
constexpr uint32_t kMostDepth = 200;
constexpr int kMostBrackets = 100;  // in style sheets
constexpr size_t kMostElements = 1'000'000;
// The work of a drawing in bytes that are parsed or drawn. Elements count each time they are used,
// so the file's size does not limit the work.
constexpr double kBytesOfAnElement = 128, kBytesOfAVertex = 4;
constexpr double kMostWork = kMostElements * kBytesOfAnElement + (128 << 20);
constexpr size_t kMostTextBytes = 2000;      // librsvg needs minutes for longer ones
constexpr double kMostFontPixels = 500'000;  // librsvg terminates the process at two million
constexpr size_t kMostKinds = 20;            // of unknown elements that are named
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

constexpr absl::string_view kSvgNamespace = "http://www.w3.org/2000/svg";

// Elements that librsvg draws, elements that those use, and elements that are invisible.
constexpr absl::string_view kKnown =
    " a circle clipPath color-profile cursor defs desc ellipse filter font-face g glyph hkern "
    "image "
    "line linearGradient marker mask metadata missing-glyph path pattern polygon polyline "
    "radialGradient rect stop style svg switch symbol text title tref tspan use view vkern ";

// Properties that librsvg 2.54 ignores although they change the picture.
constexpr absl::string_view kIgnoredProperties =
    " alignment-baseline all backdrop-filter clip color-interpolation d dominant-baseline "
    "font-feature-settings font-kerning font-size-adjust font-variant-caps font-variation-settings "
    "inline-size kerning mask-border mask-image offset-path outline rotate scale shape-inside "
    "shape-subtract text-decoration-line text-emphasis text-shadow text-transform transform-box "
    "transform-origin translate vector-effect white-space word-spacing zoom ";
// Properties of the page, which are those of the outermost element.
constexpr absl::string_view kPageProperties = " background background-color background-image ";
// Attributes that it ignores.
constexpr absl::string_view kIgnoredAttributes =
    " alignment-baseline clip color-interpolation dominant-baseline font-size-adjust kerning "
    "transform-origin vector-effect word-spacing pathLength ";
constexpr absl::string_view kIgnoredAttributesOfTexts = " lengthAdjust rotate textLength ";
// Values with which these have no effect.
constexpr absl::string_view kInitialValues[] = {
    "",         "none",       "normal",   "auto",    "0",      "0px",        "0 0",
    "0px 0px",  "0,0",        "srgb",     "inherit", "unset",  "revert",     "initial",
    "baseline", "alphabetic", "view-box", "spacing", "nowrap", "transparent"};
// Attributes whose values may have functions.
constexpr absl::string_view kValueAttributes =
    " clip-path color cursor cx cy fill fill-opacity flood-color font-size height mask opacity r "
    "rx "
    "ry stop-color stop-opacity stroke stroke-dasharray stroke-dashoffset stroke-opacity "
    "stroke-width width x x1 x2 y y1 y2 ";
constexpr absl::string_view kKnownFunctions =
    " url rgb rgba hsl hsla matrix translate translatex translatey scale scalex scaley rotate skew "
    "skewx skewy icc-color ";
constexpr size_t kMostIgnoredKinds = 40;  // that are named
constexpr size_t kLongestName = 40;

// Returns whether `word` is one of `words`, which have spaces around them.
bool HasWord(absl::string_view words, absl::string_view word) {
  if (word.empty()) return false;
  for (size_t at = words.find(word); at != absl::string_view::npos; at = words.find(word, at + 1)) {
    const size_t end = at + word.size();
    if (at > 0 && words[at - 1] == ' ' && end < words.size() && words[end] == ' ') return true;
  }
  return false;
}

struct NamedKind {
  absl::string_view element, kind;
};
constexpr NamedKind kLeftOut[] = {{"script", "scripts"},
                                  {"animate", "animations"},
                                  {"animateColor", "animations"},
                                  {"animateMotion", "animations"},
                                  {"animateTransform", "animations"},
                                  {"set", "animations"},
                                  {"foreignObject", "foreign objects"},
                                  {"textPath", "texts along paths"},
                                  {"font", "fonts"},
                                  {"video", "videos"},
                                  {"audio", "sounds"}};

absl::string_view View(const xmlChar* text) {
  return text == nullptr ? absl::string_view() : reinterpret_cast<const char*>(text);
}

bool IsKnown(absl::string_view name) {
  return absl::StartsWith(name, "fe") || absl::StrContains(kKnown, absl::StrCat(" ", name, " "));
}

// Returns: why librsvg does not draw this picture, as a kind of left-out content; empty if it does.
absl::string_view PictureFault(absl::string_view href) {
  href = absl::StripLeadingAsciiWhitespace(href);
  if (href.empty()) return "";
  if (!absl::StartsWithIgnoreCase(href, "data:")) return "pictures in other files";
  const size_t comma = std::min(href.find(','), href.size() - 1);
  const absl::string_view data = absl::StripLeadingAsciiWhitespace(href.substr(comma + 1));
  // gdk-pixbuf has these built in; it needs plug-ins for others.
  if (!absl::StartsWith(data, "iVBORw0K") && !absl::StartsWith(data, "/9j/"))
    return "pictures other than PNG and JPEG";
  std::string bytes;
  GdkPixbufLoader* loader = gdk_pixbuf_loader_new();
  bool is_good = absl::Base64Unescape(data, &bytes) &&
                 gdk_pixbuf_loader_write(loader, reinterpret_cast<const guchar*>(bytes.data()),
                                         bytes.size(), nullptr) != FALSE;
  is_good = gdk_pixbuf_loader_close(loader, nullptr) != FALSE && is_good;
  g_object_unref(loader);
  return is_good ? "" : "damaged pictures";
}

// Returns whether these are pairs of numbers. librsvg does not draw shapes with other points.
bool ArePoints(absl::string_view text) {
  size_t numbers = 0;
  const char* const whitespace = " \t\r\n\f";
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(whitespace), text.size()));
    if (numbers > 0 && absl::ConsumePrefix(&text, ",")) {
      text.remove_prefix(std::min(text.find_first_not_of(whitespace), text.size()));
      if (text.empty()) return false;
    }
    if (text.empty()) return numbers % 2 == 0;
    // A number is a sign, digits with at most one point among them, and an exponent.
    size_t end = text[0] == '-' || text[0] == '+' ? 1 : 0, digits = 0;
    bool point = false;
    for (; end < text.size() && (absl::ascii_isdigit(text[end]) || (text[end] == '.' && !point));
         ++end) {
      point |= text[end] == '.';
      digits += text[end] == '.' ? 0 : 1;
    }
    if (digits == 0 || text[end - 1] == '.') return false;
    if (end < text.size() && (text[end] == 'e' || text[end] == 'E')) {
      size_t exponent = end + 1;
      if (exponent < text.size() && (text[exponent] == '-' || text[exponent] == '+')) ++exponent;
      if (exponent == text.size() || !absl::ascii_isdigit(text[exponent])) return false;
      end = exponent;
      while (end < text.size() && absl::ascii_isdigit(text[end])) ++end;
    }
    text.remove_prefix(end);
    ++numbers;
  }
}

// The largest font sizes that a text uses.
struct FontSizes {
  double pixels = 64;  // of sizes in units of length, and by name
  double times = 1;    // of sizes relative to the element around

  void AddValue(absl::string_view text) {
    // The size is among other words of "font".
    for (const absl::string_view word :
         absl::StrSplit(text, absl::ByAnyChar(" \t\r\n/;:}"), absl::SkipEmpty())) {
      const size_t unit = std::min(word.find_first_not_of("0123456789+-.eE"), word.size());
      double number = 0;
      absl::string_view digits = word.substr(0, unit), rest = word.substr(unit);
      // The e of a unit is not an exponent.
      while (!digits.empty() && !absl::ascii_isdigit(digits.back())) digits.remove_suffix(1);
      rest = word.substr(digits.size());
      if (digits.empty()) continue;
      if (!absl::SimpleAtod(digits, &number)) number = std::numeric_limits<double>::infinity();
      number = std::abs(number);
      constexpr double kPixelsPerInch = 96;
      if (absl::StartsWith(rest, "%")) {
        times = std::max(times, number / 100);
      } else if (absl::StartsWith(rest, "e") || absl::StartsWith(rest, "r") ||
                 absl::StartsWith(rest, "ch")) {
        times = std::max(times, number);
      } else {
        pixels = std::max(pixels, rest.empty() || rest == "px" ? number : number * kPixelsPerInch);
      }
    }
  }

  // Adds the declarations of a style.
  void AddStyle(absl::string_view style) {
    for (size_t at = style.find("font"); at != absl::string_view::npos;
         at = style.find("font", at + 4)) {
      absl::string_view rest = style.substr(at + 4);
      absl::ConsumePrefix(&rest, "-size");
      rest = absl::StripLeadingAsciiWhitespace(rest);
      if (absl::ConsumePrefix(&rest, ":")) AddValue(rest.substr(0, rest.find_first_of(";}")));
    }
  }

  // Returns the largest size at that nesting depth.
  double Greatest(uint32_t depth) const { return pixels * std::pow(times, depth); }
};

// Calls `visit` with each id in url(#…) in `text`.
template <typename Visit>
void ForEachUrl(absl::string_view text, Visit visit) {
  for (size_t at = text.find("url("); at != absl::string_view::npos; at = text.find("url(", at)) {
    at += 4;
    absl::string_view rest = text.substr(at);
    rest = rest.substr(0, rest.find(')'));
    rest = absl::StripAsciiWhitespace(rest);
    while (!rest.empty() && (rest.front() == '"' || rest.front() == '\'')) rest.remove_prefix(1);
    while (!rest.empty() && (rest.back() == '"' || rest.back() == '\'')) rest.remove_suffix(1);
    if (absl::ConsumePrefix(&rest, "#")) visit(rest);
  }
}

bool IsInitialValue(absl::string_view value) {
  const std::string lower = absl::AsciiStrToLower(value);
  return std::find(std::begin(kInitialValues), std::end(kInitialValues), lower) !=
         std::end(kInitialValues);
}

// Returns where the string, comment or text in parentheses that begins at `at` ends; `at` if none
// begins there.
size_t EndOfGroup(absl::string_view text, size_t at) {
  const char first = text[at];
  if (first == '"' || first == '\'') {
    size_t end = at + 1;
    while (end < text.size() && text[end] != first) end += text[end] == '\\' ? 2 : 1;
    return std::min(end + 1, text.size());
  }
  if (absl::StartsWith(text.substr(at), "/*")) {
    const size_t end = text.find("*/", at + 2);
    return end == absl::string_view::npos ? text.size() : end + 2;
  }
  if (first != '(') return at;
  int depth = 0;
  for (size_t end = at; end < text.size(); ++end) {
    depth += text[end] == '(' ? 1 : text[end] == ')' ? -1 : 0;
    if (depth == 0) return end + 1;
  }
  return text.size();
}

// Calls `visit` with the name and the value of each declaration of a style or a style sheet, and
// with the selectors of its rule (empty in a style). Skips the rules within @media and others,
// which librsvg ignores and ReadStyleSheet counts.
template <typename Visit>
void ForEachDeclaration(absl::string_view text, Visit visit) {
  size_t begin = 0;
  uint64_t depth = 0;
  bool in_at_rule = false;
  absl::string_view selectors;
  const auto end_at = [&](size_t at) {
    const absl::string_view one = text.substr(begin, at - begin);
    const size_t colon = one.find(':');
    if (colon == absl::string_view::npos || in_at_rule) return;
    absl::string_view value = absl::StripAsciiWhitespace(one.substr(colon + 1));
    value = absl::StripAsciiWhitespace(value.substr(0, value.rfind("!important")));
    const std::string name =
        absl::AsciiStrToLower(absl::StripAsciiWhitespace(one.substr(0, colon)));
    visit(name, value, selectors);
  };
  for (size_t at = 0; at < text.size();) {
    const size_t end = EndOfGroup(text, at);
    if (end > at) {
      // A comment is not a part of the name after it.
      const bool is_before = absl::StripAsciiWhitespace(text.substr(begin, at - begin)).empty();
      if (text[at] == '/' && is_before) begin = end;
      at = end;
      continue;
    }
    const char c = text[at];
    if (c == '{') {
      if (depth++ == 0) {
        selectors = absl::StripAsciiWhitespace(text.substr(begin, at - begin));
        in_at_rule = absl::StartsWith(selectors, "@");
      }
    } else if (c == ';' || c == '}') {
      end_at(at);
      if (c == '}' && depth > 0 && --depth == 0) selectors = "", in_at_rule = false;
    }
    ++at;
    if (c == '{' || c == ';' || c == '}') begin = at;
  }
  end_at(text.size());
}

// Returns whether rules for this medium do not apply to a normal screen.
bool IsOtherMedium(absl::string_view medium) {
  return medium == "print" || medium == "speech" ||
         absl::StrContains(medium, "prefers-color-scheme: dark") ||
         absl::StrContains(medium, "prefers-color-scheme:dark");
}

class Scanner {
 public:
  explicit Scanner(const SourceFile& file) : file_(file) {}

  absl::StatusOr<SvgContents> Scan(absl::string_view xml) {
    xmlSAXHandler handler = {};
    xmlSAXVersion(&handler, 2);
    handler.startElementNs = [](void* context, const xmlChar* name, const xmlChar*,
                                const xmlChar* space, int, const xmlChar**, int count, int,
                                const xmlChar** attributes) {
      Of(context)->Start(context, View(name), View(space), count, attributes);
    };
    handler.endElementNs = [](void* context, const xmlChar*, const xmlChar*, const xmlChar*) {
      Of(context)->End();
    };
    handler.characters = [](void* context, const xmlChar* text, int length) {
      Of(context)->Text({reinterpret_cast<const char*>(text), static_cast<size_t>(length)});
    };
    handler.cdataBlock = handler.characters;
    handler.ignorableWhitespace = handler.characters;
    handler.comment = nullptr;
    handler.reference = nullptr;
    handler.processingInstruction = [](void* context, const xmlChar* target, const xmlChar* data) {
      if (View(target) == "xml-stylesheet" && !absl::StrContains(View(data), "href=\"#") &&
          !absl::StrContains(View(data), "href='#")) {
        Of(context)->Count("style sheets in other files");
      }
    };
    handler.entityDecl = [](void* context, const xmlChar* name, int type, const xmlChar* public_id,
                            const xmlChar* system_id, xmlChar* content) {
      Of(context)->Entity(context, View(name), View(content));
      xmlSAX2EntityDecl(context, name, type, public_id, system_id, content);
    };
    handler.warning = handler.error = nullptr;
    handler.serror = [](void*, xmlError*) {};
    const std::unique_ptr<xmlParserCtxt, void (*)(xmlParserCtxt*)> context(xmlNewParserCtxt(),
                                                                           xmlFreeParserCtxt);
    if (context == nullptr)
      return absl::ResourceExhaustedError(absl::StrCat(file_.path, ": no memory"));
    *context->sax = handler;
    context->_private = this;
    // External entities are not loaded without XML_PARSE_NOENT and XML_PARSE_DTDLOAD.
    xmlDoc* document =
        xmlCtxtReadMemory(context.get(), xml.data(), static_cast<int>(xml.size()), nullptr, nullptr,
                          XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING);
    if (document != nullptr) xmlFreeDoc(document);
    if (!status_.ok()) return status_;
    if (document == nullptr || context->wellFormed == 0) {
      const xmlError* error = xmlCtxtGetLastError(context.get());
      const std::string reason =
          error == nullptr || error->message == nullptr ? "" : error->message;
      return FileError(
          file_,
          absl::StrCat("is not well-formed XML (line ", error == nullptr ? 0 : error->line, ": ",
                       EscapeForTerminal(absl::StripAsciiWhitespace(reason).substr(0, 200)), ")"),
          "an SVG drawing is expected");
    }
    if (elements_.empty()) return FileError(file_, "has no element", "<svg> is expected");
    if (absl::Status status = CheckWork(); !status.ok()) return status;
    for (const auto& [name, count] : unknown_)
      contents_.left_out.push_back({absl::StrCat("<", name, "> elements"), count});
    contents_.can_draw_texts =
        longest_text_ <= kMostTextBytes && fonts_.Greatest(elements_[0].depth) <= kMostFontPixels;
    return std::move(contents_);
  }

 private:
  struct Element {
    uint32_t parent = kNone, first_child = kNone, next_sibling = kNone;
    uint32_t first_use = 0, uses = 0;  // in uses_
    bool is_target = false;            // url(#…) draws it where it is named
    bool is_marker = false;            // drawn at each vertex
    // The totals including everything that is drawn with it.
    uint32_t depth = 0;
    double work = 0;
    double bytes = 0;  // size of its path data or points
    int line = 0;
  };
  struct Use {
    std::string id;
    bool by_url = false;
    bool by_vertex = false;  // as a marker
  };

  static Scanner* Of(void* context) {
    return static_cast<Scanner*>(static_cast<xmlParserCtxt*>(context)->_private);
  }

  void Fail(void* context, absl::Status status) {
    if (status_.ok()) status_ = std::move(status);
    xmlStopParser(static_cast<xmlParserCtxt*>(context));
  }

  void Count(absl::string_view kind) {
    for (LeftOut& one : contents_.left_out) {
      if (one.kind == kind) {
        ++one.count;
        return;
      }
    }
    contents_.left_out.push_back({std::string(kind), 1});
  }

  void CountUnknown(absl::string_view name) {
    for (auto& [known, count] : unknown_) {
      if (known == name) {
        ++count;
        return;
      }
    }
    if (unknown_.size() >= kMostKinds) return Count("other elements");
    unknown_.emplace_back(EscapeForTerminal(name.substr(0, 60)), 1);
  }

  void CountIgnored(absl::string_view kind) {
    if (ignored_kinds_.contains(kind) || ignored_kinds_.size() < kMostIgnoredKinds) {
      ignored_kinds_.emplace(kind);
      Count(kind);
    } else {
      Count("other properties");
    }
  }

  // Counts a value with a function that librsvg does not know: it ignores the whole value.
  void CountFunctions(absl::string_view value) {
    for (size_t at = value.find('('); at != absl::string_view::npos; at = value.find('(', at + 1)) {
      size_t begin = at;
      while (begin > 0 && (absl::ascii_isalnum(static_cast<unsigned char>(value[begin - 1])) ||
                           value[begin - 1] == '-'))
        --begin;
      const std::string name = absl::AsciiStrToLower(value.substr(begin, at - begin));
      if (name == "url") at = std::min(value.find(')', at), value.size() - 1);
      if (name.empty() || name.size() > kLongestName || HasWord(kKnownFunctions, name)) continue;
      return CountIgnored(absl::StrCat("values with ", name, "()"));
    }
  }

  void CountDeclaration(absl::string_view name, absl::string_view value, bool of_page) {
    if (HasWord(kIgnoredProperties, name) || (of_page && HasWord(kPageProperties, name))) {
      const bool is_one = value == "1" && (name == "scale" || name == "zoom");
      if (!IsInitialValue(value) && !is_one) CountIgnored(absl::StrCat(name, " properties"));
      return;
    }
    // librsvg ignores transforms with percentages or turns.
    if (name == "transform" && (absl::StrContains(value, '%') || absl::StrContains(value, "turn")))
      return CountIgnored("transform properties");
    for (const absl::string_view other :
         {"filter", "animation", "transition", "-", "src", "content", "background", "@"}) {
      if (absl::StartsWith(name, other)) return;
    }
    CountFunctions(value);
  }

  // Counts the attributes of an element, and the properties in its style, that librsvg ignores.
  void CountIgnoredAttributes(absl::string_view element, int count, const xmlChar** attributes) {
    const bool is_text = element == "text" || element == "tspan" || element == "tref";
    bool has_transform = false, has_style_transform = false;
    for (int i = 0; i < count; ++i) {
      const absl::string_view key = View(attributes[5 * i]);
      const absl::string_view value = absl::StripAsciiWhitespace(
          absl::string_view(reinterpret_cast<const char*>(attributes[5 * i + 3]),
                            static_cast<size_t>(attributes[5 * i + 4] - attributes[5 * i + 3])));
      if (attributes[5 * i + 1] != nullptr) continue;  // of a namespace
      has_transform |= key == "transform";
      const bool is_ignored = HasWord(kIgnoredAttributes, key) ||
                              (is_text && HasWord(kIgnoredAttributesOfTexts, key)) ||
                              (element == "symbol" && (key == "refX" || key == "refY"));
      if (is_ignored && !IsInitialValue(value)) CountIgnored(absl::StrCat(key, " attributes"));
      if (HasWord(kValueAttributes, key)) CountFunctions(value);
      if (is_text && (key == "x" || key == "y" || key == "dx" || key == "dy") &&
          value.find_first_of(" ,\t\r\n") != absl::string_view::npos)
        CountIgnored("positions of single letters");
      if (key != "style") continue;
      ForEachDeclaration(value,
                         [&](absl::string_view name, absl::string_view of, absl::string_view) {
                           has_style_transform |= name == "transform" && !IsInitialValue(of);
                           CountDeclaration(name, of, elements_.empty());
                         });
    }
    // In CSS the property overrides the attribute; in librsvg it is the other way round.
    if (has_transform && has_style_transform) CountIgnored("transform properties");
  }

  // Elements in entities would be drawn without being checked here.
  void Entity(void* context, absl::string_view name, absl::string_view content) {
    if (!absl::StrContains(content, '<')) return;
    Fail(context, FileError(file_,
                            absl::StrCat("defines the entity \"",
                                         EscapeForTerminal(name.substr(0, 60)), "\" with elements"),
                            "entities of text are read"));
  }

  void Start(void* context, absl::string_view name, absl::string_view space, int count,
             const xmlChar** attributes) {
    const int line = xmlSAX2GetLineNumber(context);
    if (elements_.empty() && name != "svg") {
      return Fail(
          context,
          FileError(file_, absl::StrCat("is XML of <", EscapeForTerminal(name.substr(0, 60)), ">"),
                    "<svg> is expected"));
    }
    if (elements_.size() >= kMostElements) {
      return Fail(context,
                  FileError(file_, absl::StrCat("has more than ", kMostElements, " elements"),
                            absl::StrCat("at most ", kMostElements, " are read")));
    }
    const auto index = static_cast<uint32_t>(elements_.size());
    Element element;
    element.line = line;
    element.first_use = static_cast<uint32_t>(uses_.size());
    element.work = kBytesOfAnElement;
    if (!open_.empty()) {
      element.parent = open_.back();
      std::swap(element.next_sibling, elements_[open_.back()].first_child);
      elements_[open_.back()].first_child = index;
    }
    const bool is_svg = space.empty() || space == kSvgNamespace;
    Read(name, is_svg, count, attributes, index, &element);
    element.uses = static_cast<uint32_t>(uses_.size()) - element.first_use;
    elements_.push_back(element);
    open_.push_back(index);
  }

  void Read(absl::string_view name, bool is_svg, int count, const xmlChar** attributes,
            uint32_t index, Element* element) {
    absl::string_view href;
    bool wrong_points = false, has_href = false, needs_extension = false, filtered = false;
    for (int i = 0; i < count; ++i) {
      const absl::string_view key = View(attributes[5 * i]);
      const absl::string_view value(
          reinterpret_cast<const char*>(attributes[5 * i + 3]),
          static_cast<size_t>(attributes[5 * i + 4] - attributes[5 * i + 3]));
      element->work += static_cast<double>(value.size());
      if (key == "id") ids_.emplace(std::string(value), index);
      if (key == "href" && (!has_href || attributes[5 * i + 1] == nullptr))
        href = value, has_href = true;
      if (key == "d" || key == "points") element->bytes = static_cast<double>(value.size());
      if (key == "points" && is_svg) wrong_points = !ArePoints(value);
      if (key == "requiredExtensions") needs_extension |= !value.empty();
      if (key == "filter") filtered |= absl::StripAsciiWhitespace(value) != "none";
      if (key == "font-size" || key == "font") fonts_.AddValue(value);
      if (key == "style") {
        fonts_.AddStyle(value);
        filtered |= SetsFilter(value);
        brackets_ = std::max(brackets_, BracketDepth(value, '"'));
      }
      const bool by_vertex = key == "marker" || key == "marker-mid" ||
                             (key == "style" && absl::StrContains(value, "marker"));
      ForEachUrl(value, [&](absl::string_view id) {
        uses_.push_back({std::string(id), true, by_vertex});
      });
    }
    // The contents of a left-out element are left out too.
    if (left_out_depth_ > 0) {
      ++left_out_depth_;
      return;
    }
    if (!is_svg) return;
    element->is_target =
        name == "pattern" || name == "mask" || name == "marker" || name == "clipPath";
    element->is_marker = name == "marker";
    if (wrong_points && (name == "polygon" || name == "polyline"))
      Count("polygons with wrong points");
    if (filtered && name != "filter") Count("filters");
    if (!absl::StartsWith(name, "fe")) CountIgnoredAttributes(name, count, attributes);
    if (name == "use" || name == "pattern") {
      absl::string_view id = absl::StripAsciiWhitespace(href);
      if (absl::ConsumePrefix(&id, "#")) {
        uses_.push_back({std::string(id)});
        if (name == "use") used_.emplace_back(id);
      } else if (has_href && !id.empty()) {
        Count("elements of other files");
      }
    } else if (name == "image") {
      const absl::string_view fault = PictureFault(href);
      if (!fault.empty()) Count(fault);
    } else if (name == "text") {
      ++contents_.texts;
      text_bytes_ = 0;
      open_text_ = index;
    } else if (name == "style") {
      in_style_ = true;
    } else {
      for (const NamedKind& kind : kLeftOut) {
        if (kind.element != name) continue;
        // No program draws elements that require extensions, such as the data of Adobe Illustrator.
        if (!needs_extension) Count(kind.kind);
        left_out_depth_ = 1;
        return;
      }
      if (!IsKnown(name)) {
        if (!needs_extension) CountUnknown(name);
        left_out_depth_ = 1;
      }
    }
  }

  void End() {
    if (open_.empty()) return;
    if (open_text_ == open_.back()) open_text_ = kNone;
    open_.pop_back();
    if (left_out_depth_ > 0) --left_out_depth_;
    if (in_style_) ReadStyleSheet();
    in_style_ = false;
    style_.clear();
  }

  void Text(absl::string_view text) {
    if (!open_.empty()) elements_[open_.back()].work += static_cast<double>(text.size());
    if (in_style_) absl::StrAppend(&style_, text);
    if (open_text_ != kNone) longest_text_ = std::max(longest_text_, text_bytes_ += text.size());
  }

  static bool SetsFilter(absl::string_view style) {
    for (size_t at = style.find("filter"); at != absl::string_view::npos;
         at = style.find("filter", at + 1)) {
      if (at > 0 &&
          (absl::ascii_isalnum(static_cast<unsigned char>(style[at - 1])) || style[at - 1] == '-'))
        continue;
      absl::string_view rest = absl::StripLeadingAsciiWhitespace(style.substr(at + 6));
      if (!absl::ConsumePrefix(&rest, ":")) continue;
      if (!absl::StartsWith(absl::StripLeadingAsciiWhitespace(rest), "none")) return true;
    }
    return false;
  }

  void ReadStyleSheet() {
    brackets_ = std::max(brackets_, BracketDepth(style_, '"'));
    fonts_.AddStyle(style_);
    ForEachUrl(style_, [&](absl::string_view id) { style_targets_.emplace(id); });
    for (size_t at = style_.find('}'), from = 0; from < style_.size();
         from = at + 1, at = style_.find('}', from)) {
      if (at == std::string::npos) at = style_.size();
      if (SetsFilter(absl::string_view(style_).substr(from, at - from))) Count("filters");
    }
    ForEachDeclaration(
        style_, [&](absl::string_view name, absl::string_view value, absl::string_view selectors) {
          const bool of_page =
              absl::StrContains(selectors, "svg") || absl::StrContains(selectors, ":root");
          CountDeclaration(name, value, of_page);
        });
    const absl::string_view text = style_;
    for (size_t at = text.find('@'); at != absl::string_view::npos; at = text.find('@', at + 1)) {
      absl::string_view rest = text.substr(at + 1);
      const size_t end = std::min(rest.find_first_of(" \t\r\n{;(\"'"), rest.size());
      const std::string rule = absl::AsciiStrToLower(rest.substr(0, end));
      const absl::string_view of =
          absl::StripAsciiWhitespace(rest.substr(0, rest.find('{')).substr(end));
      if (rule == "import") Count("imported style sheets");
      if (rule == "font-face") Count("fonts");
      if (rule == "keyframes" || rule == "-webkit-keyframes") Count("animations");
      if ((rule == "media" && !IsOtherMedium(of)) || rule == "supports" || rule == "layer" ||
          rule == "container") {
        Count(absl::StrCat("@", rule, " rules"));
      }
    }
  }

  absl::Status TooDeep(const Element& element) const {
    return FileError(file_,
                     absl::StrCat("line ", element.line,
                                  ": elements are within each other, or use each other, more than ",
                                  kMostDepth, " deep or without end"),
                     absl::StrCat("at most ", kMostDepth, " deep are read"));
  }

  // Computes depth and work of every element with everything it uses, without recursion.
  absl::Status CheckWork() {
    if (brackets_ > kMostBrackets) {
      return FileError(file_, absl::StrCat("has a style with brackets ", brackets_, " deep"),
                       absl::StrCat("at most ", kMostBrackets, " deep are read"));
    }
    for (const std::string& id : used_) {
      if (!ids_.contains(id)) Count("uses of elements that are missing");
    }
    struct Visit {
      uint32_t element, next_child, next_use;
    };
    enum : uint8_t { kNew, kOpen, kDone };
    std::vector<uint8_t> state(elements_.size(), kNew);
    std::vector<Visit> stack;
    const auto open = [&](uint32_t index) {
      state[index] = kOpen;
      elements_[index].depth = 1;
      stack.push_back({index, elements_[index].first_child, 0});
    };
    const auto add = [&](uint32_t to, uint32_t from, double times) {
      elements_[to].depth = std::max(elements_[to].depth, elements_[from].depth + 1);
      elements_[to].work += times * elements_[from].work;
    };
    open(0);
    while (!stack.empty()) {
      Visit& top = stack.back();
      const uint32_t index = top.element;
      Element& element = elements_[index];
      if (stack.size() > kMostDepth) return TooDeep(element);
      if (top.next_child != kNone) {
        const uint32_t child = top.next_child;
        if (state[child] == kNew) {
          open(child);
          continue;
        }
        if (state[child] == kOpen) return TooDeep(element);
        top.next_child = elements_[child].next_sibling;
        add(index, child, 1);
      } else if (top.next_use < element.uses) {
        const double bytes = element.bytes;
        const Use& use = uses_[element.first_use + top.next_use];
        const auto found = ids_.find(use.id);
        if (found == ids_.end() || (use.by_url && !elements_[found->second].is_target)) {
          ++top.next_use;
        } else if (state[found->second] == kNew) {
          open(found->second);
        } else if (state[found->second] == kOpen) {
          return TooDeep(element);
        } else {
          ++top.next_use;
          add(index, found->second,
              use.by_vertex && elements_[found->second].is_marker ? bytes / kBytesOfAVertex : 1);
        }
      } else {
        state[index] = kDone;
        stack.pop_back();
      }
    }
    // Elements that a style sheet names may be drawn within any element, except within themselves.
    uint64_t depth = elements_[0].depth;
    for (const std::string& id : style_targets_) {
      const auto found = ids_.find(id);
      if (found != ids_.end() && elements_[found->second].is_target)
        depth += elements_[found->second].depth;
    }
    if (depth > kMostDepth) return TooDeep(elements_[0]);
    if (elements_[0].work <= kMostWork) return absl::OkStatus();
    return FileError(
        file_, "its elements use each other too often",
        absl::StrCat("at most ", kMostElements, " elements with all that they use are read"));
  }

  const SourceFile& file_;
  absl::Status status_;
  SvgContents contents_;
  std::vector<Element> elements_;
  std::vector<Use> uses_;
  std::vector<uint32_t> open_;
  std::unordered_map<std::string, uint32_t> ids_;
  std::vector<std::string> used_;
  std::unordered_set<std::string> style_targets_;
  std::vector<std::pair<std::string, uint64_t>> unknown_;
  absl::flat_hash_set<std::string> ignored_kinds_;
  uint32_t left_out_depth_ = 0;
  int brackets_ = 0;
  bool in_style_ = false;
  FontSizes fonts_;
  uint32_t open_text_ = kNone;
  size_t text_bytes_ = 0, longest_text_ = 0;  // of the open text, and of the longest
  std::string style_;
};

}  // namespace

absl::StatusOr<SvgContents> ScanSvg(const SourceFile& file, absl::string_view xml) {
  return Scanner(file).Scan(xml);
}

}  // namespace voxeld::voxelctl
