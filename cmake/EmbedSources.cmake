# Writes a C++ source that contains other sources as text: FormulaSources() of
# gpu/cuda/formula_source.h.
#   cmake -DROOT=… -DSOURCES=a;b -DOUTPUT=… -P EmbedSources.cmake
set(text "// Written by cmake/EmbedSources.cmake.\n#include \"gpu/cuda/formula_source.h\"\n\n")
string(APPEND text "namespace voxeld::gpu::cuda {\nnamespace {\n\nconstexpr NamedSource kSources[] = {\n")
foreach(source ${SOURCES})
  file(READ ${ROOT}/${source} content)
  string(APPEND text "    {\"${source}\", R\"voxeld(${content})voxeld\"},\n")
endforeach()
# The parts of the standard library that these sources use.
string(APPEND text "    {\"cstddef\", \"using size_t = decltype(sizeof(0));\\n\"},\n")
string(APPEND text "    {\"cstdint\", R\"voxeld(
using int8_t = signed char;
using uint8_t = unsigned char;
using int16_t = short;
using uint16_t = unsigned short;
using int32_t = int;
using uint32_t = unsigned int;
using int64_t = long long;
using uint64_t = unsigned long long;
)voxeld\"},\n")
string(APPEND text "    {\"cstring\", R\"voxeld(
#include <cstddef>
namespace std {
using ::memcpy;
}
)voxeld\"},\n")
string(APPEND text "};\n\n}  // namespace\n\nstd::span<const NamedSource> FormulaSources() { return kSources; }\n\n")
string(APPEND text "}  // namespace voxeld::gpu::cuda\n")
file(WRITE ${OUTPUT} "${text}")
