#include "tools/import/gdal_map.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_vsi.h>
#include <libxml/parser.h>
#include <libxml/tree.h>
#include <libxml/xmlreader.h>
#include <ogr_featurestyle.h>
#include <ogr_spatialref.h>
#include <ogr_srs_api.h>
#include <ogrsf_frmts.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>
#include <new>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/import/nesting.h"
#include "tools/voxelctl/import/map_lines.h"

namespace voxeld::voxelctl {
namespace {

constexpr char kProjFolder[] = "/usr/share/proj";
constexpr char kFolder[] = "/vsimem/map/";
constexpr int kDeepest = 100;
// LIBKML also makes fields of elements that are not data. They get this prefix, so that data may
// have any name.
constexpr char kKmlElement[] = "voxeld:";
constexpr const char* kKmlElements[] = {"NAME",       "DESCRIPTION",  "TIMESTAMP",  "BEGIN",
                                        "END",        "ALTITUDEMODE", "TESSELLATE", "EXTRUDE",
                                        "VISIBILITY", "DRAWORDER",    "ICON",       "SNIPPET"};

// Environment variables also configure GDAL and PROJ.
void ForgetEnvironment() {
  std::vector<std::string> names;
  for (char** one = environ; one != nullptr && *one != nullptr; ++one) {
    const std::string name(*one, std::string(*one).find('='));
    for (const char* prefix : {"GDAL_", "OGR_", "OSR_", "CPL_", "VSI", "PROJ_", "SHAPE_", "GPX_",
                               "LIBKML_", "KML_", "DBF_"}) {
      if (absl::StartsWith(name, prefix)) names.push_back(name);
    }
  }
  for (const std::string& name : names) ::unsetenv(name.c_str());
}

// Runs once per process.
void PrepareGdal() {
  static const bool kDone = [] {
    ForgetEnvironment();
    CPLSetConfigOption("GDAL_CONFIG_FILE", "");
    CPLSetConfigOption("GDAL_DRIVER_PATH", "disable");
    CPLSetConfigOption("GDAL_NUM_THREADS", "1");
    CPLSetConfigOption("SHAPE_RESTORE_SHX", "YES");
    CPLSetConfigOption("GPX_ELE_AS_25D", "YES");
    CPLSetConfigOption("LIBKML_RESOLVE_STYLE", "YES");
    for (const char* const element : kKmlElements) {
      CPLSetConfigOption(absl::StrCat("LIBKML_", element, "_FIELD").c_str(),
                         absl::StrCat(kKmlElement, element).c_str());
    }
    RegisterOGRShape();
    RegisterOGRGPX();
    RegisterOGRLIBKML();
    const char* const folders[] = {kProjFolder, nullptr};
    OSRSetPROJSearchPaths(folders);
    OSRSetPROJEnableNetwork(false);
    return true;
  }();
  (void)kDone;
}

// While it lives, errors are kept for LastError and not printed.
class QuietErrors {
 public:
  QuietErrors() {
    CPLPushErrorHandler(CPLQuietErrorHandler);
    CPLErrorReset();
  }
  ~QuietErrors() { CPLPopErrorHandler(); }
  QuietErrors(const QuietErrors&) = delete;
  QuietErrors& operator=(const QuietErrors&) = delete;
};

// Returns GDAL's last message, without its names of files in memory.
std::string LastError() {
  std::string text = CPLGetLastErrorMsg();
  for (size_t at; (at = text.find(kFolder)) != std::string::npos;)
    text.erase(at, sizeof(kFolder) - 1);
  absl::StripAsciiWhitespace(&text);
  return EscapeForTerminal(text.substr(0, 200));
}

// Files in GDAL's memory, which refer to the bytes without a copy.
class FilesInMemory {
 public:
  FilesInMemory() = default;
  FilesInMemory(const FilesInMemory&) = delete;
  FilesInMemory& operator=(const FilesInMemory&) = delete;
  ~FilesInMemory() { VSIRmdirRecursive("/vsimem/map"); }

  // `bytes` must outlive this.
  std::string Add(const std::string& extension, const std::string& bytes) {
    std::string name = absl::StrCat(kFolder, "map.", extension);
    // GDAL opens the file for reading only.
    auto* const data = reinterpret_cast<GByte*>(const_cast<char*>(bytes.data()));
    VSILFILE* const opened = VSIFileFromMemBuffer(name.c_str(), data, bytes.size(), FALSE);
    if (opened != nullptr) VSIFCloseL(opened);
    return name;
  }
};

// Old files begin with a folder, document or placemark, which LIBKML expects within <kml>. Returns:
// the text wrapped in that element; empty if `text` begins otherwise.
std::string WithRoot(absl::string_view text) {
  size_t at = 0;
  for (;;) {
    at = text.find('<', at);
    if (at == absl::string_view::npos) return "";
    const absl::string_view rest = text.substr(at);
    const char* const end = absl::StartsWith(rest, "<!--") ? "-->"
                            : absl::StartsWith(rest, "<?") ? "?>"
                                                           : nullptr;
    if (end == nullptr) break;
    at = text.find(end, at);
    if (at == absl::string_view::npos) return "";
  }
  const absl::string_view root = text.substr(at);
  for (const char* name : {"<Folder", "<Document", "<Placemark"}) {
    if (absl::StartsWith(root, name)) {
      return absl::StrCat(text.substr(0, at), "<kml xmlns=\"http://www.opengis.net/kml/2.2\">",
                          root, "</kml>");
    }
  }
  return "";
}

absl::string_view NameOf(const xmlNode& node) {
  return node.type == XML_ELEMENT_NODE && node.name != nullptr
             ? reinterpret_cast<const char*>(node.name)
             : absl::string_view();
}

// Returns whether the element itself, not one within it, is switched off.
bool IsSwitchedOff(const xmlNode& element) {
  for (const xmlNode* child = element.children; child != nullptr; child = child->next) {
    if (NameOf(*child) != "visibility") continue;
    std::string text;
    for (const xmlNode* part = child->children; part != nullptr; part = part->next) {
      if (part->type == XML_TEXT_NODE && part->content != nullptr)
        absl::StrAppend(&text, reinterpret_cast<const char*>(part->content));
    }
    const absl::string_view value = absl::StripAsciiWhitespace(text);
    if (value == "0" || value == "false") return true;
  }
  return false;
}

// The parts of a KML file that GDAL ignores: placemarks that the folders around them hide, and
// elements that are not shown.
struct KmlContents {
  uint64_t hidden = 0;
  std::vector<std::pair<const char*, uint64_t>> left_out;  // kinds
  std::string visible;  // the file without its hidden placemarks; empty if it has none
};

// Requires valid XML: otherwise it finds nothing, and GDAL reports the error.
KmlContents ScanKml(absl::string_view text) {
  static constexpr std::pair<absl::string_view, const char*> kKinds[] = {
      {"GroundOverlay", "ground overlays"},
      {"ScreenOverlay", "screen overlays"},
      {"PhotoOverlay", "photo overlays"},
      {"NetworkLink", "network links"},
      {"Model", "models"},
      {"Tour", "tours"}};
  KmlContents contents;
  for (const auto& [element, kind] : kKinds) contents.left_out.emplace_back(kind, 0);
  // A coordinate list may exceed libxml2's limit for texts. Without entities no text can grow.
  const int huge = absl::StrContains(text, "<!ENTITY") ? 0 : XML_PARSE_HUGE;
  const std::unique_ptr<xmlDoc, decltype(&xmlFreeDoc)> document(
      xmlReadMemory(text.data(), static_cast<int>(text.size()), nullptr, nullptr,
                    XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING | huge),
      &xmlFreeDoc);
  xmlNode* node = document == nullptr ? nullptr : xmlDocGetRootElement(document.get());
  std::vector<bool> off;             // of the elements around the next one
  std::vector<xmlNode*> placemarks;  // hidden ones
  // Visits an element before those within it.
  while (node != nullptr) {
    const absl::string_view name = NameOf(*node);
    for (size_t i = 0; i < std::size(kKinds); ++i)
      contents.left_out[i].second += name == kKinds[i].first ? 1 : 0;
    const bool is_off = (!off.empty() && off.back()) || IsSwitchedOff(*node);
    if (name == "Placemark" && is_off) placemarks.push_back(node);
    if (node->children != nullptr && node->type == XML_ELEMENT_NODE) {
      off.push_back(is_off);
      node = node->children;
      continue;
    }
    while (node != nullptr && node->next == nullptr) {
      node = off.empty() ? nullptr : node->parent;
      if (!off.empty()) off.pop_back();
    }
    if (node != nullptr) node = off.empty() ? nullptr : node->next;
  }
  contents.hidden = placemarks.size();
  if (placemarks.empty()) return contents;
  for (xmlNode* placemark : placemarks) {
    xmlUnlinkNode(placemark);
    xmlFreeNode(placemark);
  }
  xmlChar* bytes = nullptr;
  int size = 0;
  xmlDocDumpMemory(document.get(), &bytes, &size);
  if (bytes == nullptr) throw std::bad_alloc();
  contents.visible.assign(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size));
  xmlFree(bytes);
  return contents;
}

// Checks places, because GDAL reads one that is not a number as 0. Counts the colours that
// extensions give to tracks and routes (DisplayColor of Garmin, color of others); GPX has none
// itself. Errors: InvalidArgument with the line of the first invalid place.
absl::Status CheckGpx(const SourceFile& file, uint64_t* colors) {
  const std::unique_ptr<xmlTextReader, decltype(&xmlFreeTextReader)> reader(
      xmlReaderForMemory(file.bytes.data(), static_cast<int>(file.bytes.size()), nullptr, nullptr,
                         XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING),
      &xmlFreeTextReader);
  if (reader == nullptr) return absl::OkStatus();  // GDAL reports the error
  while (xmlTextReaderRead(reader.get()) == 1) {
    if (xmlTextReaderNodeType(reader.get()) != XML_READER_TYPE_ELEMENT) continue;
    const absl::string_view element =
        reinterpret_cast<const char*>(xmlTextReaderConstLocalName(reader.get()));
    if (element == "DisplayColor" || element == "color") ++*colors;
    if (element != "wpt" && element != "rtept" && element != "trkpt") continue;
    for (const auto& [name, most] : {std::pair("lat", 90.0), std::pair("lon", 180.0)}) {
      const std::unique_ptr<xmlChar, void (*)(void*)> text(
          xmlTextReaderGetAttribute(reader.get(), reinterpret_cast<const xmlChar*>(name)),
          [](void* one) { xmlFree(one); });
      double value = 0;
      if (text != nullptr && absl::SimpleAtod(reinterpret_cast<const char*>(text.get()), &value) &&
          std::abs(value) <= most)
        continue;
      return FileError(
          file,
          absl::StrCat(
              "line ", xmlTextReaderGetParserLineNumber(reader.get()), " has a <", element, "> ",
              text == nullptr
                  ? absl::StrCat("without ", name)
                  : absl::StrCat("with ", name, "=\"",
                                 EscapeForTerminal(
                                     absl::string_view(reinterpret_cast<const char*>(text.get()))
                                         .substr(0, 40)),
                                 "\"")),
          absl::StrCat("degrees from -", most, " to ", most, " are expected"));
    }
  }
  return absl::OkStatus();
}

class GdalMapReader {
 public:
  GdalMapReader(const SourceFile& file, bool globe, bool attributes)
      : file_(file), globe_(globe), lines_(file, globe, attributes) {}

  absl::StatusOr<Model> Read();

 private:
  absl::Status ReadLayer(OGRLayer* layer);
  absl::Status ReadFeature(const OGRFeature& feature);
  absl::Status PrepareTransformation(OGRLayer* layer);
  MapFeature StyleOf(const OGRFeature& feature);
  void AddNumbers(const OGRFeature& feature, MapFeature* style) const;
  absl::Status Draw(const OGRGeometry& geometry);
  absl::Status DrawLine(const OGRSimpleCurve& line, bool closed);

  const SourceFile& file_;
  const bool globe_;
  MapLines lines_;
  std::vector<SourceFile> beside_;
  std::unique_ptr<OGRCoordinateTransformation> to_degrees_;
};

// Returns whether the feature is a picture on the ground, of which LIBKML provides the outline.
bool IsOverlay(const OGRFeature& feature) {
  const int field = feature.GetFieldIndex("voxeld:ICON");
  return field >= 0 && feature.IsFieldSetAndNotNull(field) &&
         *feature.GetFieldAsString(field) != '\0';
}

std::optional<Rgb> ColorOf(OGRStyleTool* tool, const char* text) {
  int r = 0, g = 0, b = 0, a = 255;
  if (text == nullptr || !tool->GetRGBFromString(text, r, g, b, a)) return std::nullopt;
  const auto channel = [](int value) { return static_cast<uint8_t>(std::clamp(value, 0, 255)); };
  return WithOpacity({channel(r), channel(g), channel(b)}, a / 255.0);
}

MapFeature GdalMapReader::StyleOf(const OGRFeature& feature) {
  MapFeature style;
  std::optional<Rgb> fill;
  bool is_wide = false, is_large = false, has_symbol = false;
  OGRStyleMgr styles;
  styles.InitFromFeature(const_cast<OGRFeature*>(&feature));
  const int parts = feature.GetStyleString() == nullptr ? 0 : styles.GetPartCount();
  for (int i = 0; i < std::min(parts, 16); ++i) {
    const std::unique_ptr<OGRStyleTool> tool(styles.GetPart(i));
    if (tool == nullptr) continue;
    GBool is_default = false;
    if (auto* const pen = dynamic_cast<OGRStylePen*>(tool.get())) {
      const char* const color = pen->Color(is_default);
      if (!is_default) style.line = ColorOf(pen, color);
      pen->SetUnit(OGRSTUPixel);
      const double width = pen->Width(is_default);
      is_wide |= !is_default && width != 1;
    } else if (auto* const brush = dynamic_cast<OGRStyleBrush*>(tool.get())) {
      const char* const color = brush->ForeColor(is_default);
      if (!is_default) fill = ColorOf(brush, color);
    } else if (auto* const symbol = dynamic_cast<OGRStyleSymbol*>(tool.get())) {
      const char* const color = symbol->Color(is_default);
      if (!is_default) style.point = ColorOf(symbol, color);
      const double size = symbol->Size(is_default);
      is_large |= !is_default && size != 1;
      const char* const id = symbol->Id(is_default);
      has_symbol |= !is_default && id != nullptr && *id != '\0';
    }
  }
  // A style may be for points and lines: only the part that the geometry uses counts.
  const OGRGeometry* const geometry = feature.GetGeometryRef();
  const bool is_point = geometry != nullptr && geometry->getDimension() == 0;
  lines_.LeaveOut(kLineWidths, is_wide && !is_point ? 1 : 0);
  lines_.LeaveOut(kPointSizes, is_large && is_point ? 1 : 0);
  lines_.LeaveOut(kPointSymbols, has_symbol && is_point ? 1 : 0);
  if (fill && geometry != nullptr && geometry->getDimension() == 2)
    lines_.LeaveOut("fills of areas");
  if (!style.line) style.line = fill;
  return style;
}

// KML's data have no type unless a schema gives one, so texts that are numbers count too.
void GdalMapReader::AddNumbers(const OGRFeature& feature, MapFeature* style) const {
  const bool is_kml = file_.extension == "kml";
  for (int i = 0; i < feature.GetFieldCount(); ++i) {
    const OGRFieldDefn& field = *feature.GetFieldDefnRef(i);
    const absl::string_view name = field.GetNameRef();
    if (!feature.IsFieldSetAndNotNull(i) || absl::StartsWith(name, kKmlElement)) continue;
    const OGRFieldType type = field.GetType();
    double value = 0;
    if (type == OFTInteger || type == OFTInteger64 || type == OFTReal) {
      style->numbers.emplace_back(name, feature.GetFieldAsDouble(i));
    } else if (is_kml && type == OFTString &&
               absl::SimpleAtod(feature.GetFieldAsString(i), &value)) {
      style->numbers.emplace_back(name, value);
    }
  }
}

absl::Status GdalMapReader::DrawLine(const OGRSimpleCurve& line, bool closed) {
  std::vector<LonLat> corners(static_cast<size_t>(line.getNumPoints()));
  for (size_t i = 0; i < corners.size(); ++i) {
    const int at = static_cast<int>(i);
    corners[i] = {line.getX(at), line.getY(at)};
    if (line.Is3D()) corners[i].height = line.getZ(at);
  }
  return lines_.AddLine(corners, closed);
}

// The recursion is as deep as the file's elements, and that depth is limited.
absl::Status GdalMapReader::Draw(const OGRGeometry& geometry) {
  if (geometry.IsEmpty()) {
    lines_.LeaveOut("geometries without coordinates");
    return absl::OkStatus();
  }
  if (geometry.IsMeasured()) lines_.LeaveOut("geometries' measures");
  absl::Status status;
  if (const auto* const point = dynamic_cast<const OGRPoint*>(&geometry)) {
    LonLat at{point->getX(), point->getY()};
    if (point->Is3D()) at.height = point->getZ();
    return lines_.AddPoint(at);
  }
  if (const auto* const line = dynamic_cast<const OGRSimpleCurve*>(&geometry))
    return DrawLine(*line, false);
  if (const auto* const polygon = dynamic_cast<const OGRPolygon*>(&geometry)) {
    for (const OGRLinearRing* ring : *polygon) {
      if (status.ok()) status = DrawLine(*ring, true);
    }
    return status;
  }
  if (const auto* const surface = dynamic_cast<const OGRPolyhedralSurface*>(&geometry)) {
    for (const OGRPolygon* part : *surface) {
      if (status.ok()) status = Draw(*part);
    }
    return status;
  }
  if (const auto* const collection = dynamic_cast<const OGRGeometryCollection*>(&geometry)) {
    for (const OGRGeometry* part : *collection) {
      if (status.ok()) status = Draw(*part);
    }
    return status;
  }
  lines_.LeaveOut(absl::StrCat("geometries of type ", geometry.getGeometryName()));
  return absl::OkStatus();
}

absl::Status GdalMapReader::ReadFeature(const OGRFeature& feature) {
  if (IsOverlay(feature)) return absl::OkStatus();  // already counted by ScanKml
  const OGRGeometry* const geometry = feature.GetGeometryRef();
  if (geometry == nullptr) {
    lines_.LeaveOut("features without a geometry");
    return absl::OkStatus();
  }
  MapFeature style = StyleOf(feature);
  AddNumbers(feature, &style);
  lines_.BeginFeature(style);
  const std::unique_ptr<OGRGeometry> linear(geometry->getLinearGeometry());
  if (linear == nullptr) return absl::OkStatus();
  if (to_degrees_ != nullptr && linear->transform(to_degrees_.get()) != OGRERR_NONE) {
    return FileError(
        file_,
        absl::StrCat("has a position that has no longitude and latitude (", LastError(), ")"),
        "play the map without --globe");
  }
  return Draw(*linear);
}

absl::Status GdalMapReader::PrepareTransformation(OGRLayer* layer) {
  to_degrees_.reset();
  const OGRSpatialReference* const system = layer->GetSpatialRef();
  if (!globe_ || system == nullptr || system->IsGeographic()) return absl::OkStatus();
  OGRSpatialReference degrees;
  const bool good = degrees.SetWellKnownGeogCS("WGS84") == OGRERR_NONE;
  degrees.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  if (good) to_degrees_.reset(OGRCreateCoordinateTransformation(system, &degrees));
  if (to_degrees_ != nullptr) return absl::OkStatus();
  const char* const name = system->GetName();
  return FileError(file_,
                   absl::StrCat("its coordinate system ",
                                name == nullptr ? "without a name" : EscapeForTerminal(name),
                                " cannot become longitude and latitude (", LastError(), ")"),
                   "play the map without --globe");
}

absl::Status GdalMapReader::ReadLayer(OGRLayer* layer) {
  // GPX: points of routes and tracks are also in layers of their own, which are skipped.
  const absl::string_view name = layer->GetName();
  if (file_.extension == "gpx" && (name == "route_points" || name == "track_points"))
    return absl::OkStatus();
  if (absl::Status status = PrepareTransformation(layer); !status.ok()) return status;
  layer->ResetReading();
  while (const OGRFeatureUniquePtr feature{layer->GetNextFeature()}) {
    if (absl::Status status = ReadFeature(*feature); !status.ok()) return status;
  }
  if (CPLGetLastErrorType() == CE_Failure || CPLGetLastErrorType() == CE_Fatal) {
    return FileError(file_, absl::StrCat("is damaged (", LastError(), ")"), "copy the file again");
  }
  return absl::OkStatus();
}

absl::StatusOr<Model> GdalMapReader::Read() {
  struct Format {
    const char* extension;
    const char* driver;
    const char* name;
  };
  static constexpr Format kFormats[] = {
      {"shp", "ESRI Shapefile", "Shapefile"}, {"gpx", "GPX", "GPX"}, {"kml", "LIBKML", "KML"}};
  const Format& format =
      *std::find_if(std::begin(kFormats), std::end(kFormats) - 1,
                    [&](const Format& one) { return file_.extension == one.extension; });
  const bool is_xml = file_.extension != "shp";
  if (is_xml && ElementDepth(file_.bytes) > kDeepest) {
    return FileError(file_, absl::StrCat("nests elements more than ", kDeepest, " deep"),
                     "maps do not need that");
  }
  if (file_.extension == "gpx") {
    uint64_t colors = 0;
    if (absl::Status status = CheckGpx(file_, &colors); !status.ok()) return status;
    lines_.LeaveOut("colours of tracks", colors);
  }
  PrepareGdal();
  const QuietErrors quiet;
  std::string prepared;  // the text that GDAL reads instead of the file
  if (file_.extension == "kml") {
    prepared = WithRoot(file_.bytes);
    KmlContents contents = ScanKml(prepared.empty() ? file_.bytes : prepared);
    for (const auto& [kind, count] : contents.left_out) lines_.LeaveOut(kind, count);
    lines_.LeaveOut("hidden features", contents.hidden);
    if (!contents.visible.empty()) prepared = std::move(contents.visible);
  }
  FilesInMemory memory;
  if (!is_xml) {
    const std::string path = std::filesystem::path(file_.path).filename().string();
    const std::string stem = path.substr(0, path.size() - 4);
    beside_.reserve(4);
    for (const std::string extension : {"shx", "dbf", "prj", "cpg"}) {
      absl::StatusOr<SourceFile> other = ReadOtherFile(file_, absl::StrCat(stem, ".", extension));
      if (!other.ok())
        other = ReadOtherFile(file_, absl::StrCat(stem, ".", absl::AsciiStrToUpper(extension)));
      if (!other.ok()) continue;
      beside_.push_back(*std::move(other));
      memory.Add(extension, beside_.back().bytes);
    }
  }
  const std::string name = memory.Add(format.extension, prepared.empty() ? file_.bytes : prepared);
  const char* const drivers[] = {format.driver, nullptr};
  const GDALDatasetUniquePtr data(GDALDataset::Open(
      name.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR, drivers));
  if (data == nullptr) {
    return FileError(
        file_,
        absl::StrCat("is ", DescribeContents(file_.bytes), ", which GDAL does not read as ",
                     format.name, " (", LastError(), ")"),
        absl::StrCat("a map in the format ", format.name, " is expected"));
  }
  CPLErrorReset();
  for (OGRLayer* layer : data->GetLayers()) {
    if (absl::Status status = ReadLayer(layer); !status.ok()) return status;
  }
  Model model;
  if (absl::Status status = std::move(lines_).Finish(format.name, &model); !status.ok())
    return status;
  return model;
}

}  // namespace

bool IsGdalMap(absl::string_view extension) {
  return extension == "shp" || extension == "gpx" || extension == "kml";
}

std::vector<std::string> MapDataFolders() { return {kProjFolder}; }

absl::StatusOr<Model> ReadGdalMap(const SourceFile& file, bool globe, bool attributes) {
  try {
    return GdalMapReader(file, globe, attributes).Read();
  } catch (const std::bad_alloc&) {
    throw;  // the reading process is responsible for its memory
  } catch (const std::exception& error) {
    return FileError(file,
                     absl::StrCat("GDAL cannot read it (", EscapeForTerminal(error.what()), ")"),
                     "a map is expected");
  }
}

}  // namespace voxeld::voxelctl
