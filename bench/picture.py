#!/usr/bin/env python3
"""Picture of a result: density in colour, lines of equal distance, cut locus as tubes, source as ball.

usage: picture.py RESULT.vtp LOCUS.obj PICTURE.png [--range LOW,HIGH]
The left half is seen from above the source, the right half from behind. Needs vtk.
"""
import argparse
import sys
import vtk


def read(reader, path):
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def actor(source, colour=None):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    if colour:
        mapper.ScalarVisibilityOff()
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    if colour:
        made.GetProperty().SetColor(colour)
    return made


def colours(low, high):
    """A logarithmic table, pale for small densities and dark blue for large ones."""
    stops = vtk.vtkColorTransferFunction()
    for x, rgb in ((0, (0.99, 0.97, 0.87)), (0.35, (0.75, 0.87, 0.80)), (0.7, (0.25, 0.60, 0.75)),
                   (1, (0.06, 0.20, 0.45))):
        stops.AddRGBPoint(x, *rgb)
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(256)
    for i in range(256):
        table.SetTableValue(i, *stops.GetColor(i / 255), 1)
    table.SetScaleToLog10()
    table.SetTableRange(low, high)
    table.Build()
    return table


def surface_actor(result, table):
    plain = vtk.vtkPassThrough()
    plain.SetInputData(result)
    shown = actor(plain)
    mapper = shown.GetMapper()
    mapper.SetScalarModeToUseCellFieldData()
    mapper.SelectColorArray("mu")
    mapper.SetLookupTable(table)
    mapper.UseLookupTableScalarRangeOn()
    # The surface steps back behind the lines that lie on it.
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 2)
    shown.GetProperty().SetAmbient(0.35)
    shown.GetProperty().SetDiffuse(0.75)
    return shown


def contour_actor(result):
    result.GetPointData().SetActiveScalars("distance")
    contour = vtk.vtkContourFilter()
    contour.SetInputData(result)
    contour.GenerateValues(20, *result.GetPointData().GetArray("distance").GetRange())
    lines = actor(contour, (0.25, 0.25, 0.25))
    lines.GetProperty().SetLineWidth(1)
    lines.GetProperty().SetOpacity(0.55)
    return lines


def locus_actor(locus, radius):
    tube = vtk.vtkTubeFilter()
    tube.SetInputData(locus)
    tube.SetRadius(radius)
    tube.SetNumberOfSides(12)
    return actor(tube, (0.80, 0.11, 0.13))


def source_point(result):
    distance = result.GetPointData().GetArray("distance")
    nearest = min(range(distance.GetNumberOfTuples()), key=distance.GetValue)
    return result.GetPoint(nearest)


def ball_actor(centre, radius):
    ball = vtk.vtkSphereSource()
    ball.SetCenter(centre)
    ball.SetRadius(radius)
    ball.SetThetaResolution(32)
    ball.SetPhiResolution(32)
    return actor(ball, (1, 0.75, 0.1))


def half(actors, viewport, position, focus, size):
    view = vtk.vtkRenderer()
    view.SetViewport(viewport)
    view.SetBackground(1, 1, 1)
    for a in actors:
        view.AddViewProp(a)
    camera = view.GetActiveCamera()
    camera.SetFocalPoint(focus)
    camera.SetPosition([f + size * p for f, p in zip(focus, position)])
    camera.SetViewUp(0, 0, 1)
    camera.SetViewAngle(17)
    view.ResetCameraClippingRange()
    return view


def main():
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("result")
    ask.add_argument("locus")
    ask.add_argument("picture")
    ask.add_argument("--range", default="1e-2,1e2", help="densities of the two ends of the colours")
    asked = ask.parse_args()
    result = read(vtk.vtkXMLPolyDataReader(), asked.result)
    locus = read(vtk.vtkOBJReader(), asked.locus)
    size, focus, p = result.GetLength(), result.GetCenter(), source_point(result)
    table = colours(*(float(x) for x in asked.range.split(",")))
    actors = [surface_actor(result, table), contour_actor(result), locus_actor(locus, size * 0.004),
              ball_actor(p, size * 0.013)]
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetTitle("mu")
    bar.SetNumberOfLabels(5)
    bar.SetLabelFormat("%.0e")
    bar.UnconstrainedFontSizeOn()
    for text in bar.GetTitleTextProperty(), bar.GetLabelTextProperty():
        text.SetColor(0, 0, 0)
        text.SetShadow(0)
        text.SetFontSize(14)
        text.ItalicOff()
        text.BoldOff()
    bar.SetPosition(0.87, 0.15)
    bar.SetWidth(0.10)
    bar.SetHeight(0.7)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(1120, 350)
    front = half(actors, (0, 0, 0.46, 1), (1.3, -0.75, 1.4), focus, size)
    back = half(actors, (0.42, 0, 1, 1), (-1.3, -0.75, 1.4), focus, size)
    back.AddViewProp(bar)
    window.AddRenderer(front)
    window.AddRenderer(back)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    write = vtk.vtkPNGWriter()
    write.SetCompressionLevel(9)
    write.SetFileName(asked.picture)
    write.SetInputConnection(grab.GetOutputPort())
    write.Write()
    return 0


if __name__ == "__main__":
    sys.exit(main())
