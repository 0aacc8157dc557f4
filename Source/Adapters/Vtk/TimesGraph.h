#pragma once

#include <palpate/FrameStatistics.h>

#include <vtkChartXY.h>
#include <vtkNew.h>
#include <vtkTable.h>

class vtkRenderer;

namespace palpate::vtk {

/// A graph of the times of each stage over the last frames.
class TimesGraph {
 public:
  void show(vtkRenderer*, int textSize);  ///< textSize: pixels
  void add(const FrameStatistics::Stages&);

 private:
  vtkNew<vtkTable> m_times;
  vtkNew<vtkChartXY> m_chart;
  int m_frames = 0;
};

}  // namespace palpate::vtk
