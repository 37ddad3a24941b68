#include "tools/import/collada_contents.h"

#include <libxml/xmlreader.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace voxeld::voxelctl {
namespace {

// Returns whether an element contains surfaces or lines of a mesh.
bool IsPrimitive(absl::string_view name) {
  static constexpr absl::string_view kPrimitives[] = {
      "triangles", "trifans", "tristrips", "polylist", "polygons", "lines", "linestrips"};
  return std::find(std::begin(kPrimitives), std::end(kPrimitives), name) != std::end(kPrimitives);
}

class ColladaScan {
 public:
  ColladaScan(const SourceFile& file, Model* model)
      : model_(model),
        reader_(xmlReaderForMemory(
                    file.bytes.data(), static_cast<int>(file.bytes.size()), nullptr, nullptr,
                    XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING | XML_PARSE_HUGE),
                &xmlFreeTextReader) {}

  ColladaContents Run() {
    while (reader_ != nullptr && xmlTextReaderRead(reader_.get()) == 1) {
      const int type = xmlTextReaderNodeType(reader_.get());
      const std::string name =
          reinterpret_cast<const char*>(xmlTextReaderConstLocalName(reader_.get()));
      if (type == XML_READER_TYPE_END_ELEMENT) {
        Leave(name);
      } else if (type == XML_READER_TYPE_ELEMENT) {
        Enter(name);
        if (xmlTextReaderIsEmptyElement(reader_.get()) != 0) Leave(name);
      }
    }
    return Finish();
  }

 private:
  std::string Attribute(const char* name) const {
    xmlChar* const value =
        xmlTextReaderGetAttribute(reader_.get(), reinterpret_cast<const xmlChar*>(name));
    if (value == nullptr) return {};
    std::string text(reinterpret_cast<const char*>(value));
    xmlFree(value);
    return text;
  }

  void Enter(const std::string& name) {
    static constexpr std::pair<absl::string_view, const char*> kUnread[] = {
        {"spline", "splines"},
        {"convex_mesh", "convex meshes"},
        {"nurbs", "NURBS"},
        {"nurbs_surface", "NURBS"},
        {"brep", "solids of surfaces"}};
    for (const auto& [element, kind] : kUnread) {
      if (element == name) AddLeftOut(kind, 1, model_);
    }
    if (name == "effect") {
      effect_ = Attribute("id");
      effects_.try_emplace(effect_);
    } else if (name == "diffuse" || name == "emission") {
      property_ = name;
    } else if (!effect_.empty() && !property_.empty()) {
      if (property_ == "diffuse" && (name == "color" || name == "texture"))
        effects_[effect_] = true;
      if (name == "param") ++parameters_;
    } else if (name == "library_materials") {
      names_.clear();
    } else if (name == "material") {
      material_ = NameOf(Attribute("name"), Attribute("id"));
    } else if (name == "instance_effect" && !material_.empty()) {
      const std::string url = Attribute("url");
      materials_.try_emplace(material_, absl::StripPrefix(url, "#"));
    } else if (name == "instance_material") {
      bound_.insert(Attribute("symbol"));
    } else if (name == "visual_scene") {
      ++scenes_;
    } else if (name == "h") {
      ++contents_.holes;
    } else if (IsPrimitive(name)) {
      ++uses_[Attribute("material")];
    }
  }

  void Leave(const std::string& name) {
    if (name == property_) property_.clear();
    if (name == "effect") effect_.clear();
    if (name == "material") material_.clear();
  }

  // Returns assimp's name for a material. It adds numbers to later materials of the same name.
  std::string NameOf(std::string name, const std::string& id) {
    if (name.empty()) return id;
    const auto [at, is_new] = names_.try_emplace(name, 0);
    if (!is_new) absl::StrAppend(&name, " ", ++at->second);
    return name;
  }

  ColladaContents Finish() {
    for (const auto& [name, effect] : materials_) {
      const auto found = effects_.find(effect);
      if (found != effects_.end()) contents_.has_diffuse[name] = found->second;
    }
    AddLeftOut("other scenes", scenes_ > 1 ? scenes_ - 1 : 0, model_);
    AddLeftOut("colours that are parameters", parameters_, model_);
    AddLeftOut("holes of polygons, drawn filled", contents_.holes, model_);
    uint64_t unbound = 0;
    for (const auto& [symbol, count] : uses_) unbound += bound_.contains(symbol) ? 0 : count;
    if (unbound > 0 && !contents_.has_diffuse.empty()) {
      AddNote(absl::StrCat("elements without a material (", unbound,
                           ") are drawn in another element's material"),
              model_);
    }
    return std::move(contents_);
  }

  Model* const model_;
  const std::unique_ptr<xmlTextReader, decltype(&xmlFreeTextReader)> reader_;
  ColladaContents contents_;
  std::string effect_, property_, material_;      // the elements around the current one
  std::map<std::string, bool> effects_;           // whether they have a diffuse colour, by id
  std::map<std::string, std::string> materials_;  // the ids of their effects, by name
  std::map<std::string, int> names_;              // of one library's materials
  std::map<std::string, uint64_t> uses_;          // of symbols of materials
  std::set<std::string> bound_;                   // symbols
  uint64_t scenes_ = 0, parameters_ = 0;
};

}  // namespace

ColladaContents ScanCollada(const SourceFile& file, Model* model) {
  return ColladaScan(file, model).Run();
}

std::string WithoutColladaHoles(const SourceFile& file) {
  std::string out;
  const absl::string_view text = file.bytes;
  for (size_t at = text.find("<h"); at != absl::string_view::npos; at = text.find("<h", at + 2)) {
    const absl::string_view next = text.substr(at + 2, 1);
    if (next != ">" && (next.empty() || !absl::ascii_isspace(static_cast<unsigned char>(next[0]))))
      continue;
    const size_t end = text.find("</h", at);
    const size_t close = end == absl::string_view::npos ? end : text.find('>', end);
    if (close == absl::string_view::npos) break;
    if (out.empty()) out = file.bytes;
    std::fill(out.begin() + static_cast<ptrdiff_t>(at),
              out.begin() + static_cast<ptrdiff_t>(close) + 1, ' ');
  }
  return out;
}

}  // namespace voxeld::voxelctl
