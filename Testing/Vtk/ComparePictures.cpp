// ComparePictures REFERENCE PICTURE [--write]: whether a picture of 800 x 500 looks as it did.
// The reference is the picture in squares of 10 pixels, each its mean; so lines a pixel beside or
// smoother, as another Mesa draws them, are the same, and a body, contact or normal that is not
// there is not. Returns 1 where they differ.
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGReader.h>
#include <vtkPNGWriter.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace {

constexpr int kSquare = 10, kWidth = 80, kHeight = 50;
// Of 255. kMostOfOne: a line in a square has a sixteenth of it, and may be in the next.
constexpr double kMostOfOne = 32, kMostOnAverage = 0.5;

bool read(vtkImageData* image, const char* path, int width, int height) {
  vtkNew<vtkPNGReader> reader;
  reader->SetFileName(path);
  reader->Update();
  image->ShallowCopy(reader->GetOutput());
  const int* size = image->GetDimensions();
  if (size[0] == width && size[1] == height && image->GetNumberOfScalarComponents() == 3)
    return true;
  std::fprintf(stderr, "%s is no picture of %d x %d\n", path, width, height);
  return false;
}

void shrink(vtkImageData* picture, vtkImageData* squares) {
  squares->SetDimensions(kWidth, kHeight, 1);
  squares->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        double sum = 0;
        for (int i = 0; i < kSquare * kSquare; ++i)
          sum += picture->GetScalarComponentAsDouble(kSquare * x + i % kSquare,
                                                     kSquare * y + i / kSquare, 0, c);
        squares->SetScalarComponentFromDouble(x, y, 0, c, std::round(sum / (kSquare * kSquare)));
      }
    }
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 3) return 2;
  vtkNew<vtkImageData> picture, squares, reference;
  if (!read(picture, arguments[2], kSquare * kWidth, kSquare * kHeight)) return 2;
  shrink(picture, squares);
  if (count > 3 && std::strcmp(arguments[3], "--write") == 0) {
    vtkNew<vtkPNGWriter> writer;
    writer->SetFileName(arguments[1]);
    writer->SetInputData(squares);
    writer->Write();
    return 0;
  }
  if (!read(reference, arguments[1], kWidth, kHeight)) return 2;
  double most = 0, sum = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double off = std::abs(squares->GetScalarComponentAsDouble(x, y, 0, c) -
                                    reference->GetScalarComponentAsDouble(x, y, 0, c));
        most = std::max(most, off);
        sum += off;
      }
    }
  }
  const double mean = sum / (3 * kWidth * kHeight);
  std::printf("%s: %.1f of 255 at most, %.3f on average\n", arguments[1], most, mean);
  return most <= kMostOfOne && mean <= kMostOnAverage ? 0 : 1;
}
