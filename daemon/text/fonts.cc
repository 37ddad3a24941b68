#include "daemon/text/fonts.h"

#include <fontconfig/fontconfig.h>
#include <fribidi.h>
#include <ft2build.h>
#include <hb-ft.h>
#include <hb.h>
#include FT_FREETYPE_H
#include FT_TRUETYPE_TABLES_H

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "daemon/text/glyph_outline.h"
#include "daemon/text/line_break.h"
#include "display/sync/mutex.h"

namespace voxeld::text {
namespace {

constexpr size_t kMostFallbacks = 64;

// An open font file, in the font's units.
struct Face {
  FT_Face ft = nullptr;
  hb_font_t* hb = nullptr;
  double capital = 0;  // height of a capital letter
  double line = 0;     // distance between lines
  std::map<uint32_t, std::shared_ptr<const Glyph>> glyphs;

  Face() = default;
  Face(Face&&) = delete;
  ~Face() {
    if (hb != nullptr) hb_font_destroy(hb);
    if (ft != nullptr) FT_Done_Face(ft);
  }
};

absl::StatusOr<std::vector<FriBidiChar>> Characters(std::string_view utf8) {
  std::vector<FriBidiChar> characters;
  for (size_t i = 0; i < utf8.size();) {
    const auto byte = [&](size_t k) { return static_cast<uint8_t>(utf8[k]); };
    const uint8_t first = byte(i);
    const size_t length = first < 0x80   ? 1
                          : first < 0xC2 ? 0
                          : first < 0xE0 ? 2
                          : first < 0xF0 ? 3
                          : first < 0xF5 ? 4
                                         : 0;
    uint32_t code = length == 1 ? first : first & (0x7Fu >> length);
    bool good = length > 0 && i + length <= utf8.size();
    for (size_t k = 1; good && k < length; ++k) {
      good = (byte(i + k) & 0xC0) == 0x80;
      code = code << 6 | (byte(i + k) & 0x3F);
    }
    constexpr uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
    if (!good || code < kLeast[length] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) {
      return absl::InvalidArgumentError(
          absl::StrCat("is wrong at byte ", i, ", which begins no character of UTF-8"));
    }
    // Tabs and other control characters are as wide as a space.
    characters.push_back(code < 0x20 && code != '\n' ? ' ' : code);
    i += length;
  }
  return characters;
}

bool IsSpace(FriBidiChar c) { return c == ' ' || c == '\t' || c == 0x3000; }

}  // namespace

class Fonts::Library {
 public:
  Library() {
    config_ = FcInitLoadConfigAndFonts();
    const FcFontSet* const all = FcConfigGetFonts(config_, FcSetSystem);
    for (int i = 0; all != nullptr && i < all->nfont; ++i) {
      FcChar8* family = nullptr;
      for (int n = 0; FcPatternGetString(all->fonts[i], FC_FAMILY, n, &family) == FcResultMatch;
           ++n) {
        const std::string name = reinterpret_cast<const char*>(family);
        names_.emplace(absl::AsciiStrToLower(name), name);
      }
    }
    for (const char* generic : {"sans", "serif", "mono"}) names_.emplace(generic, generic);
    if (FT_Init_FreeType(&freetype_) != 0) freetype_ = nullptr;
  }
  ~Library() {
    families_.clear();
    faces_.clear();
    if (freetype_ != nullptr) FT_Done_FreeType(freetype_);
    if (config_ != nullptr) FcConfigDestroy(config_);
  }

  absl::StatusOr<LaidOut> Lay(std::string_view utf8, const Layout& layout) {
    const absl::StatusOr<std::vector<FriBidiChar>> characters = Characters(utf8);
    if (!characters.ok()) return characters.status();
    if (characters->size() > layout.most) {
      return absl::ResourceExhaustedError(
          absl::StrCat("has ", characters->size(), " characters; give at most ", layout.most));
    }
    const sync::MutexLock lock(mutex_);
    const absl::StatusOr<const Family*> family = FindFamily(layout.font);
    if (!family.ok()) return family.status();
    LaidOut out;
    double base = 0;
    FriBidiChar missing = 0;
    const double step = (*family)->faces.front()->line * layout.line_spacing;
    for (size_t begin = 0; begin <= characters->size();) {
      size_t end = begin;
      while (end < characters->size() && (*characters)[end] != '\n') ++end;
      LayParagraph(std::span(*characters).subspan(begin, end - begin), **family, layout, step,
                   &base, &missing, &out);
      if (missing != 0) {
        return absl::InvalidArgumentError(absl::StrCat(
            "has U+", absl::Hex(missing, absl::kZeroPad4), ", which no font of the server has"));
      }
      begin = end + 1;
    }
    return out;
  }

  absl::StatusOr<std::shared_ptr<const StrokeFont>> Strokes(const std::string& name) {
    const sync::MutexLock lock(mutex_);
    const auto known = strokes_.find(name);
    if (known != strokes_.end()) return known->second;
    absl::StatusOr<StrokeFont> loaded = StrokeFont::Load(name);
    if (!loaded.ok()) return loaded.status();
    return strokes_[name] = std::make_shared<const StrokeFont>(*std::move(loaded));
  }

 private:
  using FontFile = std::pair<std::string, int>;  // path, and index of the font in it
  // Fonts that are tried one after another.
  struct Family {
    std::vector<std::shared_ptr<Face>> faces;
    std::vector<FontFile> fallbacks;  // not opened yet
    size_t opened = 0;                // number of opened fallbacks
  };
  struct ShapedGlyph {
    std::shared_ptr<const Glyph> glyph;
    double x = 0, y = 0;
  };
  // A laid-out word, from left to right.
  struct Shaped {
    std::vector<ShapedGlyph> glyphs;
    double advance = 0;
  };

  std::shared_ptr<Face> Open(const FontFile& place) VOXELD_REQUIRES(mutex_) {
    const auto known = faces_.find(place);
    if (known != faces_.end()) return known->second;
    auto face = std::make_shared<Face>();
    std::shared_ptr<Face>& slot = faces_[place];
    if (freetype_ == nullptr ||
        FT_New_Face(freetype_, place.first.c_str(), place.second, &face->ft) != 0)
      return slot;
    if (!FT_IS_SCALABLE(face->ft) || face->ft->units_per_EM == 0) return slot;
    hb_face_t* const tables = hb_ft_face_create_referenced(face->ft);
    face->hb = hb_font_create(tables);  // in the font's units
    hb_face_destroy(tables);
    const double em = face->ft->units_per_EM;
    face->capital = CapitalOf(face->ft);
    const double line = face->ft->height > 0 ? face->ft->height : 1.2 * em;
    face->line = line / face->capital;
    return slot = std::move(face);
  }

  // Returns: the height of an H; without one, the height that the font states, or a common value.
  static double CapitalOf(FT_Face ft) {
    const FT_UInt glyph = FT_Get_Char_Index(ft, 'H');
    if (glyph != 0 && FT_Load_Glyph(ft, glyph, FT_LOAD_NO_SCALE | FT_LOAD_NO_HINTING) == 0 &&
        ft->glyph->metrics.horiBearingY > 0) {
      return static_cast<double>(ft->glyph->metrics.horiBearingY);
    }
    const auto* os2 = static_cast<const TT_OS2*>(FT_Get_Sfnt_Table(ft, FT_SFNT_OS2));
    return os2 != nullptr && os2->version >= 2 && os2->sCapHeight > 0 ? os2->sCapHeight
                                                                      : 0.7 * ft->units_per_EM;
  }

  // Returns: the family `name` in any case; empty: sans. The cache is bounded, because only
  // existing names are added.
  absl::StatusOr<const Family*> FindFamily(const std::string& name) VOXELD_REQUIRES(mutex_) {
    const auto named = names_.find(name.empty() ? "sans" : absl::AsciiStrToLower(name));
    if (named == names_.end()) {
      return absl::NotFoundError(
          absl::StrCat("is ", Shown(name), ", which is none; there are ", KnownFamilies()));
    }
    const auto known = families_.find(named->first);
    if (known != families_.end()) return &known->second;
    FcPattern* const wanted = FcPatternCreate();
    FcPatternAddString(wanted, FC_FAMILY, reinterpret_cast<const FcChar8*>(named->second.c_str()));
    FcPatternAddBool(wanted, FC_SCALABLE, FcTrue);
    FcConfigSubstitute(config_, wanted, FcMatchPattern);
    FcDefaultSubstitute(wanted);
    FcResult result;
    FcFontSet* const sorted = FcFontSort(config_, wanted, FcTrue, nullptr, &result);
    Family found;
    for (int i = 0; sorted != nullptr && i < sorted->nfont; ++i) {
      FcChar8* file = nullptr;
      int index = 0;
      if (FcPatternGetString(sorted->fonts[i], FC_FILE, 0, &file) != FcResultMatch) continue;
      FcPatternGetInteger(sorted->fonts[i], FC_INDEX, 0, &index);
      FontFile place{reinterpret_cast<const char*>(file), index};
      if (found.faces.empty()) {
        std::shared_ptr<Face> face = Open(place);
        if (face != nullptr) found.faces.push_back(std::move(face));
      } else if (found.fallbacks.size() < kMostFallbacks) {
        found.fallbacks.push_back(std::move(place));
      }
    }
    if (sorted != nullptr) FcFontSetDestroy(sorted);
    FcPatternDestroy(wanted);
    if (found.faces.empty()) {
      return absl::UnavailableError(
          "cannot be had: the server has no fonts; install some, as fonts-dejavu-core");
    }
    return &(families_[named->first] = std::move(found));
  }

  // Escapes a name for messages.
  static std::string Shown(const std::string& name) {
    constexpr size_t kMost = 40;
    std::string shown = absl::CHexEscape(name.substr(0, kMost));
    return name.size() > kMost ? shown + "…" : shown;
  }

  std::string KnownFamilies() const {
    constexpr size_t kMost = 12;
    std::vector<std::string> few;
    for (const auto& [lower, name] : names_) {
      if (few.size() == kMost) {
        few.emplace_back("others");
        break;
      }
      few.push_back(name);
    }
    return absl::StrJoin(few, ", ");
  }

  // Returns: false for invisible characters such as controls and formats.
  static bool IsSeen(FriBidiChar c) {
    switch (hb_unicode_general_category(hb_unicode_funcs_get_default(), c)) {
      case HB_UNICODE_GENERAL_CATEGORY_CONTROL:
      case HB_UNICODE_GENERAL_CATEGORY_FORMAT:
      case HB_UNICODE_GENERAL_CATEGORY_LINE_SEPARATOR:
      case HB_UNICODE_GENERAL_CATEGORY_PARAGRAPH_SEPARATOR:
      case HB_UNICODE_GENERAL_CATEGORY_SPACE_SEPARATOR:
        return false;
      default:
        return true;
    }
  }

  // Returns: the family's first face that has the character. If none has it, returns the first face
  // and sets `missing`.
  std::shared_ptr<Face> FaceOf(const Family& given, FriBidiChar c, FriBidiChar* missing)
      VOXELD_REQUIRES(mutex_) {
    auto& family = const_cast<Family&>(given);
    for (const std::shared_ptr<Face>& face : family.faces) {
      if (FT_Get_Char_Index(face->ft, c) != 0) return face;
    }
    while (family.opened < family.fallbacks.size()) {
      std::shared_ptr<Face> face = Open(family.fallbacks[family.opened++]);
      if (face == nullptr) continue;
      family.faces.push_back(face);
      if (FT_Get_Char_Index(face->ft, c) != 0) return face;
    }
    if (IsSeen(c) && *missing == 0) *missing = c;
    return family.faces.front();
  }

  std::shared_ptr<const Glyph> GlyphOf(Face& face, uint32_t number) VOXELD_REQUIRES(mutex_) {
    std::shared_ptr<const Glyph>& kept = face.glyphs[number];
    if (kept != nullptr) return kept;
    auto glyph = std::make_shared<Glyph>();
    if (FT_Load_Glyph(face.ft, number, FT_LOAD_NO_SCALE | FT_LOAD_NO_HINTING) == 0 &&
        face.ft->glyph->format == FT_GLYPH_FORMAT_OUTLINE) {
      glyph->contours = ContoursOf(face.ft->glyph->outline, 1 / face.capital);
    }
    return kept = std::move(glyph);
  }

  // Shapes characters of one face, script and direction.
  void ShapeRun(std::span<const FriBidiChar> text, size_t begin, size_t end, Face& face,
                bool right_to_left, Shaped* out) VOXELD_REQUIRES(mutex_) {
    hb_buffer_t* const buffer = hb_buffer_create();
    hb_buffer_add_utf32(buffer, text.data(), static_cast<int>(text.size()),
                        static_cast<unsigned>(begin), static_cast<int>(end - begin));
    hb_buffer_set_direction(buffer, right_to_left ? HB_DIRECTION_RTL : HB_DIRECTION_LTR);
    hb_buffer_guess_segment_properties(buffer);
    hb_shape(face.hb, buffer, nullptr, 0);
    unsigned count = 0;
    const hb_glyph_info_t* const infos = hb_buffer_get_glyph_infos(buffer, &count);
    const hb_glyph_position_t* const places = hb_buffer_get_glyph_positions(buffer, &count);
    for (unsigned i = 0; i < count; ++i) {
      out->glyphs.push_back({GlyphOf(face, infos[i].codepoint),
                             out->advance + places[i].x_offset / face.capital,
                             places[i].y_offset / face.capital});
      out->advance += places[i].x_advance / face.capital;
    }
    hb_buffer_destroy(buffer);
  }

  // Shapes runs of one level of a line, which are laid out from left to right.
  Shaped ShapeStretch(std::span<const FriBidiChar> text, size_t begin, size_t end,
                      bool right_to_left, const Family& family, FriBidiChar* missing)
      VOXELD_REQUIRES(mutex_) {
    struct Run {
      size_t begin, end;
      std::shared_ptr<Face> face;
    };
    std::vector<Run> runs;
    hb_unicode_funcs_t* const unicode = hb_unicode_funcs_get_default();
    hb_script_t script = HB_SCRIPT_INVALID;
    for (size_t i = begin; i < end; ++i) {
      const hb_script_t now = hb_unicode_script(unicode, text[i]);
      const bool plain =
          now == HB_SCRIPT_COMMON || now == HB_SCRIPT_INHERITED || now == HB_SCRIPT_UNKNOWN;
      // Combining marks use the face of their base character.
      std::shared_ptr<Face> face = now == HB_SCRIPT_INHERITED && !runs.empty()
                                       ? runs.back().face
                                       : FaceOf(family, text[i], missing);
      const bool same = !runs.empty() && runs.back().face == face &&
                        (plain || script == HB_SCRIPT_INVALID || script == now);
      if (same) {
        runs.back().end = i + 1;
      } else {
        runs.push_back({i, i + 1, std::move(face)});
        script = HB_SCRIPT_INVALID;
      }
      if (!plain) script = now;
    }
    if (right_to_left) std::reverse(runs.begin(), runs.end());
    Shaped shaped;
    for (const Run& run : runs)
      ShapeRun(text, run.begin, run.end, *run.face, right_to_left, &shaped);
    return shaped;
  }

  // Shapes the characters of a line in visual order.
  Shaped ShapeLine(std::span<const FriBidiChar> text, size_t begin, size_t end,
                   const std::vector<FriBidiLevel>& levels, const Family& family,
                   FriBidiChar* missing) VOXELD_REQUIRES(mutex_) {
    struct Stretch {
      size_t begin, end;
      FriBidiLevel level;
    };
    std::vector<Stretch> stretches;
    FriBidiLevel most = 0;
    for (size_t i = begin; i < end; ++i) {
      most = std::max(most, levels[i]);
      if (!stretches.empty() && stretches.back().level == levels[i]) {
        stretches.back().end = i + 1;
      } else {
        stretches.push_back({i, i + 1, levels[i]});
      }
    }
    // From the highest level down, reverse every sequence at that level or above (UAX #9, L2).
    for (FriBidiLevel level = most; level >= 1; --level) {
      for (size_t i = 0; i < stretches.size();) {
        size_t j = i;
        while (j < stretches.size() && stretches[j].level >= level) ++j;
        std::reverse(stretches.begin() + static_cast<ptrdiff_t>(i),
                     stretches.begin() + static_cast<ptrdiff_t>(j));
        i = std::max(j, i + 1);
      }
    }
    Shaped line;
    for (const Stretch& stretch : stretches) {
      const Shaped shaped =
          ShapeStretch(text, stretch.begin, stretch.end, stretch.level % 2 != 0, family, missing);
      for (const ShapedGlyph& glyph : shaped.glyphs) {
        line.glyphs.push_back({glyph.glyph, line.advance + glyph.x, glyph.y});
      }
      line.advance += shaped.advance;
    }
    return line;
  }

  void LayParagraph(std::span<const FriBidiChar> text, const Family& family, const Layout& layout,
                    double step, double* base, FriBidiChar* missing, LaidOut* out)
      VOXELD_REQUIRES(mutex_) {
    const auto count = static_cast<FriBidiStrIndex>(text.size());
    std::vector<FriBidiLevel> levels(text.size());
    if (count > 0) {
      std::vector<FriBidiCharType> types(text.size());
      std::vector<FriBidiBracketType> brackets(text.size());
      FriBidiParType direction = FRIBIDI_PAR_ON;
      fribidi_get_bidi_types(text.data(), count, types.data());
      fribidi_get_bracket_types(text.data(), count, types.data(), brackets.data());
      if (fribidi_get_par_embedding_levels_ex(types.data(), brackets.data(), count, &direction,
                                              levels.data()) == 0) {
        std::fill(levels.begin(), levels.end(), FriBidiLevel{0});
      }
    }
    std::vector<Word> words;
    for (size_t i = 0; i < text.size();) {
      size_t end = i + 1;
      while (end < text.size() && IsSpace(text[end]) == IsSpace(text[i])) ++end;
      const double advance =
          layout.width > 0 ? ShapeLine(text, i, end, levels, family, missing).advance : 0;
      words.push_back({i, end, advance, IsSpace(text[i])});
      i = end;
    }
    for (const TextLine& line : BreakLines(words, layout.width)) {
      if (line.begin < line.end) {
        const Shaped shaped = ShapeLine(text, words[line.begin].begin, words[line.end - 1].end,
                                        levels, family, missing);
        const double shift = layout.alignment == Alignment::kLeft     ? 0
                             : layout.alignment == Alignment::kCenter ? -shaped.advance / 2
                                                                      : -shaped.advance;
        for (const ShapedGlyph& glyph : shaped.glyphs) {
          if (glyph.glyph->contours.empty()) continue;
          out->glyphs.push_back({glyph.glyph, shift + glyph.x, *base + glyph.y});
        }
      }
      *base -= step;
    }
  }

  sync::Mutex mutex_;
  FcConfig* config_ = nullptr;
  FT_Library freetype_ = nullptr;
  std::map<std::string, std::string> names_;  // of families, by lower-case name; constant
  std::map<FontFile, std::shared_ptr<Face>> faces_ VOXELD_GUARDED_BY(mutex_);
  std::map<std::string, Family> families_ VOXELD_GUARDED_BY(mutex_);
  std::map<std::string, std::shared_ptr<const StrokeFont>> strokes_ VOXELD_GUARDED_BY(mutex_);
};

absl::StatusOr<std::shared_ptr<const StrokeFont>> Fonts::Strokes(const std::string& name) {
  return library_->Strokes(name);
}

Fonts::Fonts() : library_(std::make_unique<Library>()) {}
Fonts::~Fonts() = default;

absl::StatusOr<LaidOut> Fonts::Lay(std::string_view utf8, const Layout& layout) {
  return library_->Lay(utf8, layout);
}

}  // namespace voxeld::text
