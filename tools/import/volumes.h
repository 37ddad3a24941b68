// Readers of volumes, one source each. Patients have the head up and the face to the front.
//
// The table below lists the libraries. ITK 5.2.1 (libinsighttoolkit5) reads all these formats but
// is not used. It was tested with the same files as these readers:
// - It opens files by name and cannot read from memory. NIfTI needs the right extension, and NRRD and MetaImage open every file that a
//   header names, whatever its folder. So an untrusted file cannot be read in a process that may not open files.
// - A truncated NIfTI, MetaImage or MRC is read without an error: the remaining samples are uninitialised memory. Damaged DICOM
//   terminated the process by abort() in 2 to 14 of 100 attempts, because GDCM then sees the file's own elements.
// - It has errors: NIfTI's not-a-number becomes 0, and vox_offset 0 shifts the samples by four bytes; NIfTI-2 is not read. NRRD's
//   left-anterior-superior is turned to the back. MRC's mode 0 is unsigned, the order of its axes is ignored, and mode 12 is not read.
// - Its TIFF reader contains libtiff 4.0.3 of 2012, with the vulnerabilities that were found since.
// - Debian's headers of it do not compile with Clang, and it adds HDF5, MINC and FFTW.
//
// | format    | library                                              | not read |
// | NIfTI     | libnifti2 for the matrix of a checked header, zlib   | complex numbers, numbers of 128 bits |
// | NRRD      | zlib                                                 | bzip2, samples in several files |
// | MetaImage | zlib                                                 | AnatomicalOrientation without a matrix |
// | MRC       | none                                                 | complex numbers, mode 101 |
// | TIFF      | libtiff 4.5, from memory                             | pages of other sizes, channels after the first |
// | DICOM     | GDCM for compressed pixels, rewritten from what was checked | segmented palettes, 16-bit colours in run lengths |
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads neuroimaging files (.nii, .nii.gz, .hdr and .img; NIfTI-1 and NIfTI-2, in one file or two).
// Reads numbers of any type except complex ones and those of 128 bits, and colours. They are scaled
// as the header says, and placed by its sform, or otherwise by its qform. Of several volumes the
// first is shown. Takes only the memory of these samples, whatever a compressed file holds. Of two
// files either may be given. Errors: InvalidArgument with the name of the wrong field.
absl::StatusOr<Model> ReadNiftiVolume(const SourceFile& file);

// Reads nearly raw raster data (.nrrd, and .nhdr with its samples in a separate file; Teem's
// "Definition of NRRD File Format"). Two or three spatial axes are encoded as raw, gzip, hex or
// ascii. Each place has one number, or several if one more axis counts them: these are colours if
// its kind says so, otherwise the first is shown. One more axis, the last, counts volumes; the
// first volume is shown. The position is given by "space directions", "spacings" or "axis mins" and
// "axis maxs". The samples of a detached header are one file in the header's folder or below.
// Errors: InvalidArgument with the name of the wrong field.
absl::StatusOr<Model> ReadNrrdVolume(const SourceFile& file);

// Reads MetaImage (.mha, and .mhd with its samples in separate files; ITK's MetaIO documentation).
// One to four axes of numbers of any type, raw, compressed or as text, in the file itself, in one
// other, or in a file for each slice. Three or four channels of bytes are colours; of other
// channels the first is shown, of four axes the first volume. Its axes are a patient's (left,
// posterior, superior). Numbers are scaled by ElementToIntensityFunction. Errors: InvalidArgument
// with the name of the wrong field.
absl::StatusOr<Model> ReadMetaVolume(const SourceFile& file);

// Reads electron microscopy files (.mrc, .rec, .map; MRC2014 and CCP4): modes 0 (signed bytes,
// unless IMOD or the greatest density says unsigned), 1, 2, 6, 12 and IMOD's colours (16), of
// either byte order, with the axes in any order and a skewed cell. Of a stack of volumes the first
// is shown.
absl::StatusOr<Model> ReadMrcVolume(const SourceFile& file);

// Reads pictures in a stack (.tif, .tiff; TIFF 6.0 and BigTIFF): the pages of the most frequent
// size, with grey of 1 to 64 bits, colours and palettes. The spacing and the order of channels,
// slices and times are read from ImageJ's or OME's description; the first channel (or colours) at
// the first time is shown. Columns go to the right, rows to the back, and pages up.
absl::StatusOr<Model> ReadTiffVolume(const SourceFile& file);

// Reads medical images (.dcm; DICOM): all frames of one file as a volume, in spatial order. A file
// without the preamble is read too.
absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file);

// Reads the slices in a folder, sorted along their normal. Of several series, and of slices of one
// series that differ in size or orientation, the most numerous are shown; of several slices at one
// place, the first in time. The others are counted.
absl::StatusOr<Model> ReadDicomFolder(const std::string& path);

// Reads a file of only samples (.raw): cubes of length 1, z up. Errors: InvalidArgument without a
// layout, or if the file does not have exactly as many bytes.
absl::StatusOr<Model> ReadRawVolume(const SourceFile& file, const std::optional<RawLayout>& layout);

}  // namespace voxeld::voxelctl
