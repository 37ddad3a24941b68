// Readers of volumes, one source each. Patients have the head up and the face to the front.
//
// The table below lists the libraries. ITK 5.2.1 (libinsighttoolkit5) reads all these formats but is not used. It was tried on
// the same files as these readers:
// - It opens files by name and cannot read from memory. NIfTI needs the right extension, and NRRD and MetaImage open every file that a
//   header names, whatever its folder. So a stranger's file cannot be read in a process that may not open files.
// - A truncated NIfTI, MetaImage or MRC is read without an error: the rest of the samples is uninitialised memory. Damaged DICOM
//   ended the process by abort() in 2 to 14 of 100 attempts, since GDCM then sees the file's own elements.
// - Wrong: NIfTI's not-a-number becomes 0, and vox_offset 0 shifts the samples by four bytes; NIfTI-2 is not read. NRRD's
//   left-anterior-superior is turned to the back. MRC's mode 0 is unsigned, its axes' order is ignored, and mode 12 is not read.
// - Its TIFF reader contains libtiff 4.0.3 of 2012, with the vulnerabilities that were found since.
// - Debian's headers of it refuse Clang, and it adds HDF5, MINC and FFTW.
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

// Neuroimaging (.nii, .nii.gz, .hdr and .img; NIfTI-1 and NIfTI-2, in one file or two). Numbers of any type but complex ones and those
// of 128 bits, and colours, scaled as the header says, where its sform or else its qform puts them. Of several volumes the first is
// shown. Takes no more memory than these samples, whatever a compressed file holds. Of two files either may be given.
// InvalidArgument names the field that is wrong.
absl::StatusOr<Model> ReadNiftiVolume(const SourceFile& file);

// Nearly raw raster data (.nrrd, and .nhdr with its samples in a file beside it; Teem's "Definition of NRRD File Format").
// Two or three axes of places, encoded raw, gzip, hex or ascii, with a number at each, or with several, if one more axis counts
// them: colours, if its kind says so, else the first is shown. One more axis, the last, counts volumes; the first is shown. In space by
// "space directions", "spacings" or "axis mins" and "axis maxs". The samples of a detached header are one file in the header's
// folder or below. InvalidArgument names the field that is wrong.
absl::StatusOr<Model> ReadNrrdVolume(const SourceFile& file);

// MetaImage (.mha, and .mhd with its samples in files beside it; ITK's MetaIO documentation). One to four axes of numbers of any type,
// raw, compressed or as text, in the file itself, in one other, or in a file for each slice. Three or four channels of bytes are
// colours; of other channels the first is shown, of four axes the first volume. Its axes are a patient's (left, posterior, superior).
// Numbers are scaled by ElementToIntensityFunction. InvalidArgument names the field that is wrong.
absl::StatusOr<Model> ReadMetaVolume(const SourceFile& file);

// Electron microscopy (.mrc, .rec, .map; MRC2014 and CCP4). Modes 0 (signed bytes, unless IMOD or the greatest density says
// unsigned), 1, 2, 6, 12 and IMOD's colours (16), of either byte order, with the axes in any order and a skewed cell. Of a stack of
// volumes the first is shown.
absl::StatusOr<Model> ReadMrcVolume(const SourceFile& file);

// Pictures in a stack (.tif, .tiff; TIFF 6.0 and BigTIFF). Pages of one size, the size that most have: grey of 1 to 64 bits, colours
// and palettes. The spacing and the order of channels, slices and times are read from ImageJ's or OME's description; the first
// channel (or colours) at the first time is shown. Columns go to the right, rows to the back, and pages up.
absl::StatusOr<Model> ReadTiffVolume(const SourceFile& file);

// Medicine (.dcm; DICOM). All frames of one file as a volume, in the order in which they lie. A file without the preamble is read, too.
absl::StatusOr<Model> ReadDicomVolume(const SourceFile& file);

// The slices in a folder, in the order in which they lie along their normal. Of several series, and of slices of one series that
// differ in size or orientation, those are shown of which there are most; of several slices at one place the first in time.
// The others are counted.
absl::StatusOr<Model> ReadDicomFolder(const std::string& path);

// Nothing but samples (.raw): cubes of length 1, z up. InvalidArgument without a layout, or if the file does not have just as many bytes.
absl::StatusOr<Model> ReadRawVolume(const SourceFile& file, const std::optional<RawLayout>& layout);

}  // namespace voxeld::voxelctl
