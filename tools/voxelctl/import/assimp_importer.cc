// Meshes through assimp.
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <exception>
#include <optional>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

// Sharper edges stay edges when a file has no normals of its own.
constexpr float kSmoothingDegrees = 50;

// Row-major 3×4, in double precision: nodes nest.
using Matrix = std::array<double, 12>;

Matrix FromAssimp(const aiMatrix4x4& m) {
  return {m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4};
}

Matrix Compose(const Matrix& outer, const Matrix& inner) {
  Matrix r{};
  for (size_t row = 0; row < 12; row += 4) {
    for (size_t col = 0; col < 4; ++col) {
      r[row + col] = outer[row] * inner[col] + outer[row + 1] * inner[4 + col] +
                     outer[row + 2] * inner[8 + col] + (col == 3 ? outer[row + 3] : 0);
    }
  }
  return r;
}

Point3 Map(const Matrix& m, const aiVector3D& v) {
  const double x = v.x, y = v.y, z = v.z;
  return {m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7],
          m[8] * x + m[9] * y + m[10] * z + m[11]};
}

// The inverse transpose up to a positive factor, so that normals stay outside under a mirror too.
Matrix NormalMatrix(const Matrix& m) {
  const std::array<double, 9> cofactors = {
      m[5] * m[10] - m[6] * m[9], m[6] * m[8] - m[4] * m[10], m[4] * m[9] - m[5] * m[8],
      m[2] * m[9] - m[1] * m[10], m[0] * m[10] - m[2] * m[8], m[1] * m[8] - m[0] * m[9],
      m[1] * m[6] - m[2] * m[5],  m[2] * m[4] - m[0] * m[6],  m[0] * m[5] - m[1] * m[4]};
  const double determinant = m[0] * cofactors[0] + m[1] * cofactors[1] + m[2] * cofactors[2];
  const double sign = determinant < 0 ? -1 : 1;
  Matrix r{};
  for (size_t row = 0; row < 3; ++row) {
    for (size_t col = 0; col < 3; ++col) r[row * 4 + col] = sign * cofactors[row * 3 + col];
  }
  return r;
}

Point3 Unit(const Point3& p) {
  const double length = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
  if (!(length > 1e-30) || !std::isfinite(length)) return {};
  return {p.x / length, p.y / length, p.z / length};
}

uint8_t Channel(double value, bool linear) {
  if (!(value > 0)) return 0;
  value = std::min(value, 1.0);
  if (linear) value = value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(value * 255));
}

Rgb ToRgb(const aiColor4D& c, bool linear) {
  return {Channel(c.r, linear), Channel(c.g, linear), Channel(c.b, linear)};
}

// The base colour that a material states itself; none for a texture's place-holder or the
// importer's own default.
std::optional<Rgb> BaseColor(const aiMaterial& material, bool linear) {
  aiString name;
  material.Get(AI_MATKEY_NAME, name);
  if (absl::string_view(name.C_Str()) == AI_DEFAULT_MATERIAL_NAME) return std::nullopt;
  aiColor4D color;
  if (material.Get(AI_MATKEY_BASE_COLOR, color) != aiReturn_SUCCESS &&
      material.Get(AI_MATKEY_COLOR_DIFFUSE, color) != aiReturn_SUCCESS) {
    return std::nullopt;
  }
  // What the OBJ reader gives to a material that it was told nothing about.
  if (!linear && color.r == 0.6f && color.g == 0.6f && color.b == 0.6f) return std::nullopt;
  const Rgb rgb = ToRgb(color, linear);
  const bool textured = material.GetTextureCount(aiTextureType_DIFFUSE) > 0 ||
                        material.GetTextureCount(aiTextureType_BASE_COLOR) > 0;
  if (textured && rgb == Rgb{255, 255, 255}) return std::nullopt;
  return rgb;
}

struct Context {
  const SourceFile& file;
  const aiScene& scene;
  bool linear;         // colours are linear light
  bool has_materials;  // of its own; some readers make one up
  uint64_t vertices = 0, indices = 0;
  Model* model;
};

absl::Status CheckMesh(const SourceFile& file, const aiMesh& mesh) {
  if (mesh.mNumVertices > 0 && mesh.mVertices == nullptr) {
    return FileError(file, "holds a mesh without positions", "every vertex has one");
  }
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    for (unsigned i = 0; i < face.mNumIndices; ++i) {
      if (face.mIndices[i] >= mesh.mNumVertices) {
        return FileError(
            file, absl::StrCat("face ", f, " refers to vertex ", face.mIndices[i]),
            absl::StrCat("its mesh has ", mesh.mNumVertices, " vertices, counted from 0"));
      }
    }
  }
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const aiVector3D& p = mesh.mVertices[v];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
      return FileError(file, absl::StrCat("vertex ", v, " is (", p.x, ", ", p.y, ", ", p.z, ")"),
                       "coordinates must be finite");
    }
  }
  return absl::OkStatus();
}

// Parts by kind: after sorting a mesh has faces of one kind, or of points only.
absl::Status AddMesh(const aiMesh& mesh, const Matrix& to_model, Context* context) {
  const unsigned corners = mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE ? 3
                           : mesh.mPrimitiveTypes & aiPrimitiveType_LINE   ? 2
                                                                           : 1;
  if (mesh.mNumVertices == 0) return absl::OkStatus();
  context->vertices += mesh.mNumVertices;
  context->indices += uint64_t{corners} * mesh.mNumFaces;
  if (context->vertices > kMaxModelVertices || context->indices > kMaxModelIndices) {
    return FileError(context->file,
                     absl::StrCat("has over ", kMaxModelVertices, " vertices or ", kMaxModelIndices,
                                  " indices, its instances included"),
                     "so large a model is not read");
  }
  Part part;
  part.kind = corners == 3 ? Kind::kTriangles : corners == 2 ? Kind::kSegments : Kind::kPoints;
  part.positions.reserve(mesh.mNumVertices);
  for (unsigned v = 0; v < mesh.mNumVertices; ++v)
    part.positions.push_back(Map(to_model, mesh.mVertices[v]));
  if (mesh.HasNormals()) {
    const Matrix normal_matrix = NormalMatrix(to_model);
    part.normals.reserve(mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      part.normals.push_back(Unit(Map(normal_matrix, mesh.mNormals[v])));
  }
  if (mesh.HasVertexColors(0)) {
    part.colors.reserve(mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      part.colors.push_back(ToRgb(mesh.mColors[0][v], context->linear));
  } else if (context->has_materials && mesh.mMaterialIndex < context->scene.mNumMaterials) {
    const std::optional<Rgb> color =
        BaseColor(*context->scene.mMaterials[mesh.mMaterialIndex], context->linear);
    if (color) part.colors.assign(mesh.mNumVertices, *color);
  }
  if (corners > 1) {
    part.indices.reserve(size_t{corners} * mesh.mNumFaces);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != corners) continue;
      part.indices.insert(part.indices.end(), face.mIndices, face.mIndices + corners);
    }
    if (part.indices.empty()) return absl::OkStatus();
  }
  context->model->parts.push_back(std::move(part));
  return absl::OkStatus();
}

absl::Status AddNodes(const aiNode& root, Context* context) {
  struct Visit {
    const aiNode* node;
    Matrix to_model;
  };
  std::vector<Visit> stack = {{&root, FromAssimp(root.mTransformation)}};
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    for (unsigned m = 0; m < visit.node->mNumMeshes; ++m) {
      absl::Status status =
          AddMesh(*context->scene.mMeshes[visit.node->mMeshes[m]], visit.to_model, context);
      if (!status.ok()) return status;
    }
    for (unsigned c = visit.node->mNumChildren; c-- > 0;) {
      const aiNode* child = visit.node->mChildren[c];
      stack.push_back({child, Compose(visit.to_model, FromAssimp(child->mTransformation))});
    }
  }
  return absl::OkStatus();
}

std::string FormatName(const SourceFile& file) {
  if (file.extension == "glb") return "glTF binary";
  if (file.extension == "gltf") return "glTF";
  if (file.extension == "obj") return "Wavefront OBJ";
  if (file.extension == "stl") return "STL";
  return "PLY mesh";
}

class AssimpImporter final : public MeshImporter {
 public:
  absl::StatusOr<Model> Import(const SourceFile& file) const override {
    try {
      return DoImport(file);
    } catch (const std::exception& error) {
      return Failed(file, error.what());
    }
  }

 private:
  static absl::Status Failed(const SourceFile& file, absl::string_view reason) {
    return FileError(file,
                     absl::StrCat("could not be read as ", FormatName(file), " (",
                                  EscapeForTerminal(reason.substr(0, 300)), ")"),
                     "the file is damaged or uses what is not supported");
  }

  static absl::StatusOr<Model> DoImport(const SourceFile& file) {
    Assimp::Importer importer;
    importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                                aiComponent_TEXCOORDS | aiComponent_TANGENTS_AND_BITANGENTS |
                                    aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                    aiComponent_TEXTURES | aiComponent_LIGHTS |
                                    aiComponent_CAMERAS);
    importer.SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, kSmoothingDegrees);
    // Steps after reading trust the indices; so they come after a check of our own.
    const aiScene* scene = importer.ReadFile(file.path, 0);
    if (scene == nullptr) return Failed(file, importer.GetErrorString());
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
      const absl::Status status = CheckMesh(file, *scene->mMeshes[m]);
      if (!status.ok()) return status;
    }
    if (scene->mNumMeshes == 0 || scene->mRootNode == nullptr) {
      return FileError(file, "holds no mesh", "at least one is expected");
    }
    // A cloud has no faces to work on, and some steps refuse such meshes.
    const auto has_faces = [](const aiMesh* mesh) { return mesh->mNumFaces > 0; };
    if (std::all_of(scene->mMeshes, scene->mMeshes + scene->mNumMeshes, has_faces)) {
      scene = importer.ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_Triangulate |
                                           aiProcess_SortByPType | aiProcess_GenSmoothNormals |
                                           aiProcess_JoinIdenticalVertices);
      if (scene == nullptr) return Failed(file, importer.GetErrorString());
    }
    Model model;
    model.path = file.path;
    model.format = FormatName(file);
    const bool bare = file.extension == "stl" || file.extension == "ply";
    model.up = bare ? Up::kZ : Up::kY;
    Context context{.file = file,
                    .scene = *scene,
                    .linear = absl::StartsWith(file.extension, "gl"),
                    .has_materials = !bare,
                    .model = &model};
    const absl::Status status = AddNodes(*scene->mRootNode, &context);
    if (!status.ok()) return status;
    return model;
  }
};

}  // namespace

std::unique_ptr<MeshImporter> NewMeshImporter() { return std::make_unique<AssimpImporter>(); }

}  // namespace voxeld::voxelctl
